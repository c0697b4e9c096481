from .counterexample import (
    crossing_sides as crossing_sides,
)
from .counterexample import (
    crossing_time as crossing_time,
)
from .counterexample import (
    tip_over_face as tip_over_face,
)
from .memory import peak_saved_bytes as peak_saved_bytes
from .spread import (
    coverage as coverage,
)
from .spread import (
    distance_to_contour as distance_to_contour,
)
from .spread import (
    evenness as evenness,
)
from .spread import (
    exact_distance as exact_distance,
)
from .unsteady import Drifting as Drifting
from .unsteady import RootSink as RootSink
