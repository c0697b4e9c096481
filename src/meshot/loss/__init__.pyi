from .directions import (
    orthogonal_directions as orthogonal_directions,
)
from .directions import (
    quasi_directions as quasi_directions,
)
from .directions import (
    random_directions as random_directions,
)
from .error_bar import (
    SlicedEstimate as SlicedEstimate,
)
from .error_bar import (
    directions_for_translation as directions_for_translation,
)
from .error_bar import (
    sliced_wasserstein_estimate as sliced_wasserstein_estimate,
)
from .error_bar import (
    translation_spread as translation_spread,
)
from .linear_program import wasserstein as wasserstein
from .nearest import chamfer as chamfer
from .nearest import nearest_neighbours as nearest_neighbours
from .plain import plain_sliced_wasserstein as plain_sliced_wasserstein
from .plain import quantile_cost as quantile_cost
from .quasi_sets import CONSTRUCTIONS as CONSTRUCTIONS
from .sinkhorn import sinkhorn_divergence as sinkhorn_divergence
from .sliced import (
    slice_costs as slice_costs,
)
from .sliced import (
    sliced_wasserstein as sliced_wasserstein,
)
from .surface_loss import SurfaceLoss as SurfaceLoss
from .windowed import windowed_sliced_wasserstein as windowed_sliced_wasserstein
