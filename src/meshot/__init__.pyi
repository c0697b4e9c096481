from . import (
    anatomy as anatomy,
    flow as flow,
    loss as loss,
    measure as measure,
    mesh as mesh,
    metrics as metrics,
    model as model,
    pipeline as pipeline,
    study as study,
    synth as synth,
    systems as systems,
    train as train,
    view as view,
    volume as volume,
)
from .flow import Deformation as Deformation, deform as deform, integrate as integrate
from .loss import (
    SlicedEstimate as SlicedEstimate,
    chamfer as chamfer,
    orthogonal_directions as orthogonal_directions,
    quasi_directions as quasi_directions,
    random_directions as random_directions,
    sinkhorn_divergence as sinkhorn_divergence,
    slice_costs as slice_costs,
    sliced_wasserstein as sliced_wasserstein,
    sliced_wasserstein_estimate as sliced_wasserstein_estimate,
    wasserstein as wasserstein,
    windowed_sliced_wasserstein as windowed_sliced_wasserstein,
)
from .measure import (
    DiscreteMeasure as DiscreteMeasure,
    MeasureBatch as MeasureBatch,
    SurfaceMeasure as SurfaceMeasure,
    empirical as empirical,
    surface as surface,
    varifold as varifold,
)
from .mesh import (
    Contour as Contour,
    Mesh as Mesh,
    read_mesh as read_mesh,
    triangulate as triangulate,
    write_mesh as write_mesh,
)
from .metrics import evaluate as evaluate

__version__: str
