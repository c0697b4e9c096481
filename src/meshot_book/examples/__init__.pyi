from .counterexample import (
    crossing_sides as crossing_sides,
    crossing_time as crossing_time,
    tip_over_face as tip_over_face,
)
from .memory import peak_saved_bytes as peak_saved_bytes
from .miniatures import FEATURES as FEATURES, Folds as Folds, Miniature as Miniature, miniature as miniature
from .spread import (
    coverage as coverage,
    distance_to_contour as distance_to_contour,
    evenness as evenness,
    exact_distance as exact_distance,
)
from .unsteady import Drifting as Drifting, RootSink as RootSink
