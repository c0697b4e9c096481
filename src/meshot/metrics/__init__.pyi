from .alignment import Alignment as Alignment
from .alignment import rigidly_aligned as rigidly_aligned
from .distances import (
    Surface as Surface,
)
from .distances import (
    SurfaceSample as SurfaceSample,
)
from .distances import (
    average_surface_distance as average_surface_distance,
)
from .distances import (
    hausdorff_distance as hausdorff_distance,
)
from .distances import (
    normal_agreement as normal_agreement,
)
from .distances import (
    offsets_between as offsets_between,
)
from .distances import (
    vertex_distances as vertex_distances,
)
from .evaluation import Evaluation as Evaluation
from .evaluation import Metric as Metric
from .table import evaluate as evaluate
from .table import mesh_properties as mesh_properties
from .transport import (
    earth_movers_distance as earth_movers_distance,
)
from .transport import (
    sinkhorn_distance as sinkhorn_distance,
)
from .transport import (
    sliced_distance as sliced_distance,
)
from .triangles import (
    edge_length_variation as edge_length_variation,
)
from .triangles import (
    face_area_variation as face_area_variation,
)
from .triangles import (
    smallest_angles as smallest_angles,
)
