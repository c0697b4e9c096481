from .continuous import SurfaceMeasure as SurfaceMeasure, surface as surface
from .discrete import (
    DiscreteMeasure as DiscreteMeasure,
    empirical as empirical,
    require_probabilities as require_probabilities,
    varifold as varifold,
    varifold_sample as varifold_sample,
)
