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
from .descent import descend as descend
from .fit import Fit as Fit
from .fit import FitLoss as FitLoss
from .fit import fit_flow as fit_flow
from .fit import sliced_loss as sliced_loss
from .forces import probe_pulls as probe_pulls
from .forces import pulls as pulls
from .progress import fit_progress as fit_progress
from .settings import FitSettings as FitSettings
from .settings import Guard as Guard
