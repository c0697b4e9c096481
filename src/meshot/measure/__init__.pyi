from .continuous import SurfaceMeasure as SurfaceMeasure, surface as surface
from .conversion import (
    MeasureLike as MeasureLike,
    as_measures as as_measures,
    as_point_measures as as_point_measures,
)
from .discrete import (
    DiscreteMeasure as DiscreteMeasure,
    empirical as empirical,
    varifold as varifold,
    varifold_sample as varifold_sample,
)
from .probabilities import as_probabilities as as_probabilities
from .protocol import Measure as Measure
