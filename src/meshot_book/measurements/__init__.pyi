from .rows import (
    COMPARED as COMPARED,
    MAIN as MAIN,
    METRICS as METRICS,
    digest_of as digest_of,
    grouped as grouped,
    metric_values as metric_values,
    paired_gaps as paired_gaps,
    spread as spread,
)
