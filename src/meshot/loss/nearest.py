"""The Chamfer loss: squared distances to the nearest neighbour on the other side."""

import torch
from scipy.spatial import cKDTree

from meshot.measure import MeasureLike, as_point_measures
from meshot.types import Float, Int64, Tensor

#: How nearest neighbours are found; the value is the same.
NEIGHBOURS = ("tree", "brute")
_BLOCK = 1 << 23  # distances held at once by brute force: so large that their memory goes back, not into a heap


def chamfer(source: MeasureLike, target: MeasureLike, neighbours: str = "tree") -> Float[Tensor, ""]:
    """The Chamfer pseudo-distance: mean squared distance to the nearest neighbour, in both directions, added.

    With equal weights this is Equation 1 of the paper; other weights replace the means by weighted means. The
    neighbours are held fixed in the gradient, which is exact wherever they are unique.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        Any numbers of supports, any weights. An (n, d) array or tensor stands for points of equal weight, a mesh for
        the barycentres of its faces, weighted by area (:func:`meshot.empirical` draws points on it).
    neighbours : str
        "tree" for a k-d tree on the CPU; "brute" for all distances, on the device of the points, a block at a time.

    Returns
    -------
    tensor
        In squared units of the points.

    Raises
    ------
    ValueError
        If an argument is no measure of points, the measures live in different spaces, ``neighbours`` is neither of the
        two, or squared distances exceed the dtype.

    Notes
    -----
    Chamfer is symmetric and at least zero, but it violates the triangle inequality and vanishes between different
    measures with equal supports. With a tree, expected time O((n + m) log(n + m)) in low dimension; by brute force time
    O(n m). Memory O(n + m) both ways.

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
    """For every point, the index of the nearest candidate in the Euclidean norm.

    Raises
    ------
    ValueError
        If ``method`` is neither "tree" nor "brute", or squared distances exceed the dtype.
    """
    if method not in NEIGHBOURS:
        raise ValueError(f"neighbours is {method!r}; one of {', '.join(NEIGHBOURS)} is needed")
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
    # From differences: |x|² + |y|² − 2⟨x, y⟩ would cancel for near points, and choose a wrong neighbour.
    return torch.cdist(points, candidates, compute_mode="donot_use_mm_for_euclid_dist")
