from .chain import (
    Leg as Leg,
)
from .chain import (
    chain_end as chain_end,
)
from .chain import (
    chain_reports as chain_reports,
)
from .chain import (
    chain_trajectory as chain_trajectory,
)
from .deforming import Deformation as Deformation
from .deforming import deform as deform
from .descent import descend as descend
from .fit import Fit as Fit
from .fit import FitLoss as FitLoss
from .fit import fit_flow as fit_flow
from .fit import sliced_loss as sliced_loss
from .force import forces as forces
from .force import probe_forces as probe_forces
from .progress import fit_progress as fit_progress
from .settings import FitSettings as FitSettings
from .settings import Guard as Guard
