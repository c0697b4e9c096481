from .crossings import smooth_crossings as smooth_crossings
from .decimation import decimated as decimated
from .decimation import simplified as simplified
from .smoothing import (
    laplacian_smoothing as laplacian_smoothing,
)
from .smoothing import (
    neighbour_means as neighbour_means,
)
from .smoothing import (
    taubin_smoothing as taubin_smoothing,
)
from .subdivision import with_edges_split as with_edges_split
