from .penalties import (
    cotangent_laplacian_length as cotangent_laplacian_length,
    laplacian_length as laplacian_length,
    normal_inconsistency as normal_inconsistency,
    squared_edge_length as squared_edge_length,
    squared_laplacian as squared_laplacian,
)
