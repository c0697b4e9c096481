from .counts import (
    SPHERE as SPHERE,
)
from .counts import (
    Topology as Topology,
)
from .counts import (
    boundary_edges as boundary_edges,
)
from .counts import (
    component_labels as component_labels,
)
from .counts import (
    euler_number as euler_number,
)
from .counts import (
    is_consistently_oriented as is_consistently_oriented,
)
from .counts import (
    nonmanifold_edges as nonmanifold_edges,
)
from .counts import (
    topology as topology,
)
from .intersection import self_intersecting_faces as self_intersecting_faces
