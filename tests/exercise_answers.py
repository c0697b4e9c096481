"""Right answers of exercises that have many of them."""

import torch

from meshot.types import Float, Tensor


def merged_pair(target: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """The two nearest targets share one point, a third of the way; the one left over doubles a third target."""
    apart = torch.cdist(target, target).fill_diagonal_(torch.inf)
    first, second = divmod(int(apart.argmin()), len(target))
    points = target.clone()
    points[first] = (2 * target[first] + target[second]) / 3
    points[second] = target[next(i for i in range(len(target)) if i not in (first, second))]
    return points
