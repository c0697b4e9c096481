from .crossings import smooth_crossings as smooth_crossings
from .decimation import decimated as decimated, simplified as simplified
from .smoothing import (
    laplacian_smoothing as laplacian_smoothing,
    neighbour_means as neighbour_means,
    taubin_smoothing as taubin_smoothing,
)
from .subdivision import with_edges_split as with_edges_split
