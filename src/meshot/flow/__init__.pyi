from .crossings import (
    PathReport as PathReport,
    RepairedSurface as RepairedSurface,
    crossings_along as crossings_along,
    inspect_paths as inspect_paths,
    nest_surfaces as nest_surfaces,
    point_jacobians as point_jacobians,
    repair_crossings as repair_crossings,
    sampled_lipschitz as sampled_lipschitz,
    steps_below as steps_below,
)
from .fields import (
    GridVelocity as GridVelocity,
    LearnedVelocity as LearnedVelocity,
    Prepared as Prepared,
    Velocity as Velocity,
    VelocityField as VelocityField,
    grid_around as grid_around,
    quantised_velocity as quantised_velocity,
    read_velocity as read_velocity,
    single_level as single_level,
    spline_values as spline_values,
    write_velocity as write_velocity,
)
from .fitting import (
    Deformation as Deformation,
    Fit as Fit,
    FitLoss as FitLoss,
    FitSettings as FitSettings,
    Guard as Guard,
    deform as deform,
    fit_flow as fit_flow,
    fit_progress as fit_progress,
    sliced_loss as sliced_loss,
)
from .integration import METHODS as METHODS, integrate as integrate, trajectory as trajectory
