from .damping import without_crossings as without_crossings
from .guard import (
    PathReport as PathReport,
    crossings_along as crossings_along,
    inspect_paths as inspect_paths,
    steps_below as steps_below,
)
from .jacobian import point_jacobians as point_jacobians, sampled_lipschitz as sampled_lipschitz
from .repair import RepairedSurface as RepairedSurface, repair_crossings as repair_crossings
