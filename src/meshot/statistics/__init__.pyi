from .arms import arm_differences as arm_differences
from .intervals import (
    LEVEL as LEVEL,
)
from .intervals import (
    Interval as Interval,
)
from .intervals import (
    bootstrap_interval as bootstrap_interval,
)
from .intervals import (
    mean_interval as mean_interval,
)
from .intervals import (
    paired_interval as paired_interval,
)
from .intervals import (
    percentile_interval as percentile_interval,
)
from .power_laws import (
    Slope as Slope,
)
from .power_laws import (
    averages as averages,
)
from .power_laws import (
    fitted_slope as fitted_slope,
)
