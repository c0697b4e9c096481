"""The Chamfer loss: squared distances to nearest neighbours."""

import torch
from scipy.spatial import cKDTree

from meshot.errors import require_choice
from meshot.measure import MeasureLike, as_point_measures
from meshot.types import Float, Int64, Tensor

#: Methods of finding nearest neighbours. All give the same value.
NEIGHBOURS = ("tree", "brute")
_BLOCK = 1 << 23  # distances per block of brute force: large enough that the memory is returned to the system


def chamfer(source: MeasureLike, target: MeasureLike, neighbours: str = "tree") -> Float[Tensor, ""]:
    r"""The Chamfer pseudo-distance: the mean squared distance to the nearest neighbour, summed over both directions.

    .. math::

        \sum_i a_i \min_j \lVert x_i - y_j \rVert^2 + \sum_j b_j \min_i \lVert x_i - y_j \rVert^2

    With equal weights this is Equation 1 of the paper. Otherwise the means are weighted. The nearest neighbours are
    treated as constant in the gradient, which is exact where they are unique.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        Any numbers of support points, any weights. An (n, d) array or tensor means points of equal weight. A mesh means
        the barycentres of its faces, weighted by area (to draw points on it, use :func:`meshot.empirical`).
    neighbours : str
        "tree" for a k-d tree on the CPU; "brute" for all distances, in blocks, on the device of the points.

    Returns
    -------
    tensor
        In squared units of the points.

    Raises
    ------
    ValueError
        If an argument is not a measure of points, the measures are in different spaces, ``neighbours`` is unknown, or
        squared distances exceed the range of the dtype.

    Notes
    -----
    The Chamfer loss is symmetric and non-negative. It violates the triangle inequality, and it is zero between
    different measures with equal supports. Expected time O((n + m) log(n + m)) with a tree in low dimension, and O(n m)
    by brute force. Memory O(n + m) in both cases.

    References
    ----------
    Barrow et al., IJCAI 1977; Le et al., ICLR 2024, Equation 1.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> float(meshot.chamfer(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]])))  # 5² there, 5² back
    50.0
    """
    source, target = as_point_measures(source, target)
    there = nearest_neighbours(source.places, target.places, neighbours)
    back = nearest_neighbours(target.places, source.places, neighbours)
    forward = (source.places - target.places[there]).square().sum(dim=1)
    backward = (target.places - source.places[back]).square().sum(dim=1)
    return (source.weights * forward).sum() + (target.weights * backward).sum()


def nearest_neighbours(
    points: Float[Tensor, "n d"], candidates: Float[Tensor, "m d"], method: str = "tree"
) -> Int64[Tensor, " n"]:
    """The index of the nearest candidate of every point, in the Euclidean norm.

    Raises
    ------
    ValueError
        If ``method`` is neither "tree" nor "brute", or squared distances exceed the range of the dtype.
    """
    require_choice(method, "neighbours", NEIGHBOURS)
    points, candidates = points.detach(), candidates.detach()
    size = max(float(points.abs().max()), float(candidates.abs().max()))
    if not 4 * points.shape[1] * size * size <= torch.finfo(points.dtype).max:
        raise ValueError(f"coordinates reach {size:.3g}, and squared distances exceed {points.dtype}: scale both down")
    if method == "brute":
        blocks = points.split(max(1, _BLOCK // len(candidates)))
        return torch.cat([_distances(block, candidates).argmin(dim=1) for block in blocks])
    tree = cKDTree(candidates.cpu().numpy())
    _, index = tree.query(points.cpu().numpy(), workers=torch.get_num_threads())
    return torch.from_numpy(index).to(points.device, torch.int64)


def _distances(points: Tensor, candidates: Tensor) -> Tensor:
    # From differences: |x|² + |y|² − 2⟨x, y⟩ would suffer from cancellation and could give a wrong neighbour.
    return torch.cdist(points, candidates, compute_mode="donot_use_mm_for_euclid_dist")
