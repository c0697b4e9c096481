from .directions import (
    orthogonal_directions as orthogonal_directions,
    quasi_directions as quasi_directions,
    random_directions as random_directions,
)
from .error_bar import (
    directions_for_translation as directions_for_translation,
    sliced_wasserstein_estimate as sliced_wasserstein_estimate,
    translation_spread as translation_spread,
    windowed_sliced_wasserstein_estimate as windowed_sliced_wasserstein_estimate,
)
from .estimates import SlicedEstimate as SlicedEstimate, WindowedEstimate as WindowedEstimate
from .kernel_norm import varifold_kernel as varifold_kernel
from .linear_program import wasserstein as wasserstein
from .nearest import chamfer as chamfer, nearest_neighbours as nearest_neighbours
from .plain import plain_sliced_wasserstein as plain_sliced_wasserstein, quantile_cost as quantile_cost
from .quasi_sets import CONSTRUCTIONS as CONSTRUCTIONS
from .sinkhorn import sinkhorn_divergence as sinkhorn_divergence
from .sliced import (
    slice_costs as slice_costs,
    sliced_wasserstein as sliced_wasserstein,
)
from .windowed import windowed_sliced_wasserstein as windowed_sliced_wasserstein
