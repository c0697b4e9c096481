from .continuous import SurfaceMeasure as SurfaceMeasure
from .continuous import surface as surface
from .discrete import (
    DiscreteMeasure as DiscreteMeasure,
)
from .discrete import (
    empirical as empirical,
)
from .discrete import (
    require_probabilities as require_probabilities,
)
from .discrete import (
    varifold as varifold,
)
from .discrete import (
    varifold_sample as varifold_sample,
)
