from .chain import (
    Leg as Leg,
    chain_end as chain_end,
    chain_reports as chain_reports,
    chain_trajectory as chain_trajectory,
)
from .deforming import Deformation as Deformation, deform as deform
from .descent import descend as descend
from .fit import Fit as Fit, FitLoss as FitLoss, fit_flow as fit_flow, sliced_loss as sliced_loss
from .force import forces as forces, probe_forces as probe_forces
from .progress import fit_progress as fit_progress
from .settings import FitSettings as FitSettings, Guard as Guard
