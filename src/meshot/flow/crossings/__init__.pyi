from .damping import without_crossings as without_crossings
from .guard import (
    PathReport as PathReport,
)
from .guard import (
    crossings_along as crossings_along,
)
from .guard import (
    inspect_paths as inspect_paths,
)
from .guard import (
    steps_below as steps_below,
)
from .jacobian import point_jacobians as point_jacobians
from .jacobian import sampled_lipschitz as sampled_lipschitz
from .repair import RepairedSurface as RepairedSurface
from .repair import repair_crossings as repair_crossings
