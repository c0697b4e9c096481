from .composed import (
    ENCODINGS as ENCODINGS,
    LOSSES as LOSSES,
    ChamferLoss as ChamferLoss,
    Encoding as Encoding,
    MeasureLoss as MeasureLoss,
    SampleEncoding as SampleEncoding,
    SinkhornLoss as SinkhornLoss,
    SlicedLoss as SlicedLoss,
    SummedLoss as SummedLoss,
    SurfaceEncoding as SurfaceEncoding,
    SurfaceLoss as SurfaceLoss,
    VarifoldEncoding as VarifoldEncoding,
    WindowedLoss as WindowedLoss,
    loss_setting_names as loss_setting_names,
    surface_loss as surface_loss,
)
from .directions import (
    CONSTRUCTIONS as CONSTRUCTIONS,
    orthogonal_directions as orthogonal_directions,
    quasi_directions as quasi_directions,
    random_directions as random_directions,
)
from .error_bar import (
    SlicedEstimate as SlicedEstimate,
    sliced_wasserstein_estimate as sliced_wasserstein_estimate,
    windowed_sliced_wasserstein_estimate as windowed_sliced_wasserstein_estimate,
)
from .exact import ProjectedLaw as ProjectedLaw, projected_law as projected_law
from .kernel_norm import varifold_kernel as varifold_kernel
from .learned import (
    controlled_sliced_wasserstein as controlled_sliced_wasserstein,
    energy_sliced_wasserstein as energy_sliced_wasserstein,
    hilbert_transport as hilbert_transport,
    max_sliced_direction as max_sliced_direction,
    max_sliced_wasserstein as max_sliced_wasserstein,
    min_sliced_plan as min_sliced_plan,
    min_sliced_transport as min_sliced_transport,
)
from .penalties import (
    cotangent_laplacian_length as cotangent_laplacian_length,
    laplacian_length as laplacian_length,
    normal_inconsistency as normal_inconsistency,
    squared_edge_length as squared_edge_length,
    squared_laplacian as squared_laplacian,
)
from .sliced import (
    plain_sliced_wasserstein as plain_sliced_wasserstein,
    quantile_cost as quantile_cost,
    slice_costs as slice_costs,
    sliced_wasserstein as sliced_wasserstein,
)
from .transport import (
    chamfer as chamfer,
    nearest_neighbours as nearest_neighbours,
    sinkhorn_divergence as sinkhorn_divergence,
    wasserstein as wasserstein,
)
from .unbalanced import (
    sliced_partial as sliced_partial,
    sliced_unbalanced as sliced_unbalanced,
    unbalanced_sliced as unbalanced_sliced,
)
from .windowed import windowed_sliced_wasserstein as windowed_sliced_wasserstein
