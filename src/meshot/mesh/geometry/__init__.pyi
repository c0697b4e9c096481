from .areas import (
    edge_lengths as edge_lengths,
)
from .areas import (
    edge_midpoints as edge_midpoints,
)
from .areas import (
    edge_normals as edge_normals,
)
from .areas import (
    face_area_vectors as face_area_vectors,
)
from .areas import (
    face_areas as face_areas,
)
from .areas import (
    face_barycentres as face_barycentres,
)
from .areas import (
    face_corners as face_corners,
)
from .areas import (
    face_normals as face_normals,
)
from .areas import (
    mesh_edges as mesh_edges,
)
from .areas import (
    safe_norm as safe_norm,
)
from .areas import (
    signed_volume as signed_volume,
)
from .areas import (
    vertex_areas as vertex_areas,
)
from .areas import (
    vertex_normals as vertex_normals,
)
from .laplacian import (
    cotangent_vectors as cotangent_vectors,
)
from .laplacian import (
    mean_curvatures as mean_curvatures,
)
from .laplacian import (
    umbrella_vectors as umbrella_vectors,
)
from .section import plane_section as plane_section
