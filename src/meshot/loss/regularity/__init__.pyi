from .penalties import (
    cotangent_laplacian_length as cotangent_laplacian_length,
)
from .penalties import (
    laplacian_length as laplacian_length,
)
from .penalties import (
    normal_inconsistency as normal_inconsistency,
)
from .penalties import (
    squared_edge_length as squared_edge_length,
)
from .penalties import (
    squared_laplacian as squared_laplacian,
)
