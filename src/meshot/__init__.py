"""Optimal-transport losses for surfaces, from points on a line to the cortex."""

from meshot.flow.integrate import integrate
from meshot.loss.chamfer import chamfer
from meshot.loss.directions import orthogonal_directions, quasi_directions, random_directions
from meshot.loss.error_bar import SlicedEstimate, sliced_wasserstein_estimate
from meshot.loss.sinkhorn import sinkhorn_divergence
from meshot.loss.sliced import slice_costs, sliced_wasserstein
from meshot.loss.wasserstein import wasserstein
from meshot.loss.windowed import windowed_sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure, empirical, varifold
from meshot.measure.surface import SurfaceMeasure, surface
from meshot.mesh.io import read_mesh, write_mesh
from meshot.mesh.mesh import Contour, Mesh
from meshot.mesh.polygons import triangulate
from meshot.metrics.evaluate import evaluate

__all__ = [
    "Contour",
    "DiscreteMeasure",
    "Mesh",
    "SlicedEstimate",
    "SurfaceMeasure",
    "chamfer",
    "empirical",
    "evaluate",
    "integrate",
    "orthogonal_directions",
    "quasi_directions",
    "random_directions",
    "read_mesh",
    "sinkhorn_divergence",
    "slice_costs",
    "sliced_wasserstein",
    "sliced_wasserstein_estimate",
    "surface",
    "triangulate",
    "varifold",
    "wasserstein",
    "windowed_sliced_wasserstein",
    "write_mesh",
]
__version__ = "0.1.0"
