from .arms import arm_differences as arm_differences
from .intervals import (
    LEVEL as LEVEL,
    Interval as Interval,
    bootstrap_interval as bootstrap_interval,
    mean_interval as mean_interval,
    paired_interval as paired_interval,
    percentile_interval as percentile_interval,
)
from .outliers import OUTLIER_SCORE as OUTLIER_SCORE, robust_scores as robust_scores
from .power_laws import (
    Slope as Slope,
    averages as averages,
    fitted_slope as fitted_slope,
)
from .reliability import (
    intraclass_correlation as intraclass_correlation,
    people_needed as people_needed,
    power_of_groups as power_of_groups,
    within_deviation as within_deviation,
)
