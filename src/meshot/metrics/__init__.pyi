from .distances import (
    Alignment as Alignment,
    Surface as Surface,
    SurfaceSample as SurfaceSample,
    average_surface_distance as average_surface_distance,
    earth_movers_distance as earth_movers_distance,
    exact_transport as exact_transport,
    hausdorff_distance as hausdorff_distance,
    normal_agreement as normal_agreement,
    offsets_between as offsets_between,
    rigidly_aligned as rigidly_aligned,
    sinkhorn_distance as sinkhorn_distance,
    sliced_distance as sliced_distance,
    vertex_distances as vertex_distances,
)
from .evaluation import (
    Evaluation as Evaluation,
    Metric as Metric,
    edge_length_variation as edge_length_variation,
    evaluate as evaluate,
    face_area_variation as face_area_variation,
    mesh_properties as mesh_properties,
    smallest_angles as smallest_angles,
)
from .thickness import (
    LARGEST_THICKNESS_MM as LARGEST_THICKNESS_MM,
    corresponds as corresponds,
    cortical_thickness as cortical_thickness,
    cortical_volumes as cortical_volumes,
)
