from .continuous import SurfaceMeasure as SurfaceMeasure
from .continuous import surface as surface
from .conversion import MeasureLike as MeasureLike
from .conversion import as_measures as as_measures
from .conversion import as_point_measures as as_point_measures
from .discrete import (
    DiscreteMeasure as DiscreteMeasure,
)
from .discrete import (
    empirical as empirical,
)
from .discrete import (
    varifold as varifold,
)
from .discrete import (
    varifold_sample as varifold_sample,
)
from .probabilities import as_probabilities as as_probabilities
from .protocol import Measure as Measure
