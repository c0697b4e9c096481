from .counts import (
    SPHERE as SPHERE,
    Topology as Topology,
    boundary_edges as boundary_edges,
    component_labels as component_labels,
    euler_number as euler_number,
    is_consistently_oriented as is_consistently_oriented,
    nonmanifold_edges as nonmanifold_edges,
    topology as topology,
)
from .intersection import self_intersecting_faces as self_intersecting_faces
