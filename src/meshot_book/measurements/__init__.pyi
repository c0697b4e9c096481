from .digests import digest_of as digest_of
from .metrics import COMPARED as COMPARED, METRICS as METRICS, metric_values as metric_values
from .rows import MAIN as MAIN, grouped as grouped, paired_gaps as paired_gaps, spread as spread
