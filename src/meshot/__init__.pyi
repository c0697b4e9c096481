from .flow import integrate as integrate
from .flow.fitting import Deformation as Deformation
from .flow.fitting import deform as deform
from .loss import (
    SlicedEstimate as SlicedEstimate,
)
from .loss import (
    chamfer as chamfer,
)
from .loss import (
    orthogonal_directions as orthogonal_directions,
)
from .loss import (
    quasi_directions as quasi_directions,
)
from .loss import (
    random_directions as random_directions,
)
from .loss import (
    sinkhorn_divergence as sinkhorn_divergence,
)
from .loss import (
    slice_costs as slice_costs,
)
from .loss import (
    sliced_wasserstein as sliced_wasserstein,
)
from .loss import (
    sliced_wasserstein_estimate as sliced_wasserstein_estimate,
)
from .loss import (
    wasserstein as wasserstein,
)
from .loss import (
    windowed_sliced_wasserstein as windowed_sliced_wasserstein,
)
from .measure import (
    DiscreteMeasure as DiscreteMeasure,
)
from .measure import (
    SurfaceMeasure as SurfaceMeasure,
)
from .measure import (
    empirical as empirical,
)
from .measure import (
    surface as surface,
)
from .measure import (
    varifold as varifold,
)
from .mesh import (
    Contour as Contour,
)
from .mesh import (
    Mesh as Mesh,
)
from .mesh import (
    read_mesh as read_mesh,
)
from .mesh import (
    triangulate as triangulate,
)
from .mesh import (
    write_mesh as write_mesh,
)
from .metrics import evaluate as evaluate

__version__: str
