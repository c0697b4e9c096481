from .alignment import Alignment as Alignment, rigidly_aligned as rigidly_aligned
from .distances import (
    Surface as Surface,
    SurfaceSample as SurfaceSample,
    average_surface_distance as average_surface_distance,
    hausdorff_distance as hausdorff_distance,
    normal_agreement as normal_agreement,
    offsets_between as offsets_between,
    vertex_distances as vertex_distances,
)
from .evaluation import Evaluation as Evaluation, Metric as Metric
from .table import evaluate as evaluate, mesh_properties as mesh_properties
from .transport import (
    earth_movers_distance as earth_movers_distance,
    exact_transport as exact_transport,
    sinkhorn_distance as sinkhorn_distance,
    sliced_distance as sliced_distance,
)
from .triangles import (
    edge_length_variation as edge_length_variation,
    face_area_variation as face_area_variation,
    smallest_angles as smallest_angles,
)
