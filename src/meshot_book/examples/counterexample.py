"""The smallest mesh that a diffeomorphism of points makes cross itself: a tip over a face, and a push."""

import math

import torch

from meshot.errors import as_floating
from meshot.mesh import Mesh
from meshot.types import Float, Tensor
from meshot_book.flows import Push


def tip_over_face(gap: float = 0.3) -> Mesh:
    """Two triangles: one in the plane y = 0 with its corners at distance 1 from the y-axis, and one above, tip down.

    Parameters
    ----------
    gap : float
        Height of the tip, which is vertex 3 and on the axis, over the face.

    Raises
    ------
    ValueError
        If the gap is not in (0, 1).
    """
    if not 0 < gap < 1:
        raise ValueError(f"gap is {gap!r}; a height in (0, 1) is needed, under the base of the upper triangle")
    turn = math.sqrt(3) / 2
    below = [[0.0, 0.0, 1.0], [-turn, 0.0, -0.5], [turn, 0.0, -0.5]]
    above = [[0.0, gap, 0.0], [0.4, gap + 1, 0.0], [-0.4, gap + 1, 0.0]]
    return Mesh(torch.tensor(below + above, dtype=torch.float64), torch.tensor([[0, 1, 2], [3, 4, 5]]))


def crossing_time(gap: float, push: Push) -> float:
    """When the tip goes through the straight face: gap / (−strength · (1 − exp(−1/(2 width²)))).

    The tip is pushed with full strength, the three corners of the face only with exp(−1/(2 width²)) of it. The image of
    the face itself, bent by the flow, is never met.

    Raises
    ------
    ValueError
        If the push is not downward.
    """
    if not push.strength < 0:
        raise ValueError(f"strength is {push.strength!r}; a push downward, < 0, is needed to reach the face")
    return gap / (-push.strength * (1 - math.exp(-1 / (2 * push.width**2))))


def crossing_sides(outlines: Float[Tensor, "k m 2"]) -> int:
    """How many pairs of straight sides of closed outlines in the plane cross, within one outline or between two.

    Sides that only touch, as neighbours do, do not count. Every pair is looked at.

    Raises
    ------
    ValueError
        If the outlines are not finite floating-point numbers.
    """
    outlines = as_floating(outlines, "outlines")
    starts, ends = outlines.flatten(0, 1), outlines.roll(-1, dims=1).flatten(0, 1)
    first, second = torch.triu_indices(len(starts), len(starts), offset=1)
    a, b, c, d = starts[first], ends[first], starts[second], ends[second]
    apart = (_turn(a, b, c) * _turn(a, b, d) < 0) & (_turn(c, d, a) * _turn(c, d, b) < 0)
    return int(apart.sum())


def _turn(a: Tensor, b: Tensor, c: Tensor) -> Float[Tensor, " n"]:
    """Whether a → b → c turns left (1), right (−1) or not at all."""
    along, across = b - a, c - a
    return (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]).sign()
