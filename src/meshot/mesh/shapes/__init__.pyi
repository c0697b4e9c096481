from .contours import (
    circle as circle,
    letter_e as letter_e,
    near_regular_polygon as near_regular_polygon,
    regular_polygon as regular_polygon,
    star as star,
)
from .solids import (
    cube as cube,
    ellipsoid as ellipsoid,
    folded_sphere as folded_sphere,
    icosphere as icosphere,
    split_in_four as split_in_four,
    tetrahedron as tetrahedron,
)
