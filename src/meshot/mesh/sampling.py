"""Random or evenly spaced points on a mesh or contour."""

import numpy as np
import torch

from meshot.errors import require_positive_integer
from meshot.mesh.geometry.areas import edge_lengths, face_areas
from meshot.mesh.mesh import Contour, Mesh
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Int64, Tensor


def sample_points(shape: Mesh | Contour, n_points: int, generator: Generator) -> Float[Tensor, "n d"]:
    """Independent random points, uniform by area on a mesh or by length on a contour.

    A cell is drawn with probability proportional to its size, then a point uniformly in it. The points are
    differentiable with respect to the vertices, for fixed random numbers.

    Raises
    ------
    ValueError
        If ``n_points`` < 1, or the shape has zero area (or length).
    """
    cells, barycentric = sample_locations(shape, n_points, generator)
    corners = shape.vertices[(shape.edges if isinstance(shape, Contour) else shape.faces)[cells]]
    return (barycentric[:, :, None] * corners).sum(dim=1)


def sample_locations(
    shape: Mesh | Contour, n_points: int, generator: Generator
) -> tuple[Int64[Tensor, " n"], Float[Tensor, "n c"]]:
    """The cells and barycentric coordinates of a uniform random sample, see :func:`sample_points`.

    Raises
    ------
    ValueError
        As :func:`sample_points`.
    """
    require_positive_integer(n_points, "n_points")
    generator = numpy_generator(generator)
    cumulative = np.cumsum(_cell_sizes(shape))
    if not cumulative[-1] > 0:
        raise ValueError(
            f"the total area or length is {cumulative[-1]:.3g}; only a shape of positive size can be sampled"
        )
    # The upper limit excludes empty cells at the end.
    cells = np.searchsorted(cumulative, generator.random(n_points) * cumulative[-1], side="right")
    cells = np.minimum(cells, np.searchsorted(cumulative, cumulative[-1], side="left"))
    if isinstance(shape, Contour):
        along = generator.random(n_points)
        barycentric = np.stack([1 - along, along], axis=1)
    else:
        root, other = np.sqrt(generator.random(n_points)), generator.random(n_points)
        barycentric = np.stack([1 - root, root * (1 - other), root * other], axis=1)
    vertices = shape.vertices
    return torch.from_numpy(cells).to(vertices.device), torch.from_numpy(barycentric).to(vertices)


@torch.no_grad()
def _cell_sizes(shape: Mesh | Contour) -> np.ndarray:
    sizes = edge_lengths(shape) if isinstance(shape, Contour) else face_areas(shape)
    return sizes.double().cpu().numpy()


def even_points(contour: Contour, n_points: int, offset: float = 0.5) -> Float[Tensor, "n 2"]:
    """Points at equal distances of arc length along the edges of a contour, in the order of the edges.

    Parameters
    ----------
    contour : Contour
    n_points : int
    offset : float
        Arc length of the first point in units of the spacing, in [0, 1).

    Raises
    ------
    ValueError
        If ``n_points`` < 1, ``offset`` is outside [0, 1), or the contour has zero length.
    """
    require_positive_integer(n_points, "n_points")
    if not 0 <= offset < 1:
        raise ValueError(f"offset is {offset!r}; a number in [0, 1) is needed, in spacings")
    lengths = edge_lengths(contour).detach()
    cumulative = lengths.cumsum(0)
    if not float(cumulative[-1]) > 0:
        raise ValueError("the contour has no length; at least two vertices must differ")
    places = (torch.arange(n_points, dtype=lengths.dtype, device=lengths.device) + offset) * (cumulative[-1] / n_points)
    edges = torch.searchsorted(cumulative, places, right=True).clamp(max=len(lengths) - 1)
    along = (places - (cumulative[edges] - lengths[edges])) / lengths[edges]
    start, end = contour.vertices[contour.edges[edges]].unbind(dim=1)
    return start + along[:, None] * (end - start)
