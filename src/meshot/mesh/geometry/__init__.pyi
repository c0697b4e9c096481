from .areas import (
    edge_lengths as edge_lengths,
    edge_midpoints as edge_midpoints,
    edge_normals as edge_normals,
    face_area_vectors as face_area_vectors,
    face_areas as face_areas,
    face_barycentres as face_barycentres,
    face_corners as face_corners,
    face_normals as face_normals,
    mesh_edges as mesh_edges,
    safe_norm as safe_norm,
    signed_volume as signed_volume,
    vertex_areas as vertex_areas,
    vertex_normals as vertex_normals,
)
from .laplacian import (
    cotangent_vectors as cotangent_vectors,
    mean_curvatures as mean_curvatures,
    umbrella_vectors as umbrella_vectors,
)
from .section import plane_section as plane_section
from .solid import solid_moments as solid_moments
