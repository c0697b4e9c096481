"""The Chamfer loss: every point is pulled to its nearest neighbour on the other side."""

import torch
from scipy.spatial import cKDTree

from meshot.errors import require_same_space
from meshot.measure.discrete import DiscreteMeasure
from meshot.types import Float, Int64, Tensor


def chamfer(source: DiscreteMeasure, target: DiscreteMeasure) -> Float[Tensor, ""]:
    """The Chamfer pseudo-distance: mean squared distance to the nearest neighbour, in both directions, added.

    With equal weights this is Equation 1 of the paper; other weights replace the means by weighted means. The
    neighbours come from a k-d tree and are held fixed in the gradient, which is exact wherever they are unique.

    Returns
    -------
    tensor
        In squared units of the points.

    Raises
    ------
    ValueError
        If the measures live in different spaces.

    Notes
    -----
    Chamfer is symmetric and at least zero, but it violates the triangle inequality and vanishes between different
    measures with equal supports. Expected time O((n + m) log(n + m)) in low dimension.

    References
    ----------
    Barrow et al., IJCAI 1977; Le et al., ICLR 2024, Equation 1.
    """
    require_same_space(source.points, target.points)
    there, back = nearest_neighbours(source.points, target.points), nearest_neighbours(target.points, source.points)
    forward = (source.points - target.points[there]).square().sum(dim=1)
    backward = (target.points - source.points[back]).square().sum(dim=1)
    return (source.weights * forward).sum() + (target.weights * backward).sum()


def nearest_neighbours(points: Float[Tensor, "n d"], candidates: Float[Tensor, "m d"]) -> Int64[Tensor, " n"]:
    """For every point, the index of the nearest candidate in the Euclidean norm."""
    tree = cKDTree(candidates.detach().cpu().numpy())
    _, index = tree.query(points.detach().cpu().numpy(), workers=torch.get_num_threads())
    return torch.from_numpy(index).to(points.device, torch.int64)
