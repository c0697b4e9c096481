from .contours import (
    circle as circle,
)
from .contours import (
    letter_e as letter_e,
)
from .contours import (
    near_regular_polygon as near_regular_polygon,
)
from .contours import (
    regular_polygon as regular_polygon,
)
from .contours import (
    star as star,
)
from .solids import (
    cube as cube,
)
from .solids import (
    ellipsoid as ellipsoid,
)
from .solids import (
    folded_sphere as folded_sphere,
)
from .solids import (
    icosphere as icosphere,
)
from .solids import (
    require_positive as require_positive,
)
from .solids import (
    split_in_four as split_in_four,
)
from .solids import (
    tetrahedron as tetrahedron,
)
