"""Two triangles under a flow of their points: a page on which a reader makes them cross, whole in itself, offline."""

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.figure import Figure

from meshot.errors import require_positive_integer
from meshot.flow import integrate
from meshot.types import Float, Tensor
from meshot.view import BLUE, ORANGE, WIDTH, Page, live_page, still_of
from meshot_book.flows import AnalyticField, Push, Vortex

LOWER = [[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]]
#: What the page offers to move the triangles, by the names that its buttons have.
FIELDS: dict[str, AnalyticField] = {"push": Push(-1.0, 0.3), "whirl": Vortex(6.0, 0.5)}


def two_triangles(gap: float = 0.3) -> Float[Tensor, "2 3 2"]:
    """A triangle below, its upper side on y = 0 from −1 to 1, and one above with its tip at (0, gap).

    The section, at z = 0, through a pair of triangles in space as in :func:`meshot_book.examples.tip_over_face`.

    Raises
    ------
    ValueError
        If the gap is not in (0, 1).
    """
    if not 0 < gap < 1:
        raise ValueError(f"gap is {gap!r}; a height in (0, 1) is needed")
    upper = [[0.0, gap], [0.4, gap + 1], [-0.4, gap + 1]]
    return torch.tensor([LOWER, upper], dtype=torch.float64)


def outlines(
    field: AnalyticField, corners: Float[Tensor, "k 3 2"], time: float, n_steps: int, n_pieces: int
) -> Float[Tensor, "k m 2"]:
    """The outlines of triangles with every side cut into ``n_pieces``, moved for ``time`` by Euler steps.

    Only the cuts are moved; between them the outline is straight.

    Raises
    ------
    ValueError
        If a count is not a positive integer.
    """
    require_positive_integer(n_pieces, "n_pieces")
    shares = torch.arange(n_pieces, dtype=corners.dtype)[:, None] / n_pieces
    starts, ends = corners[:, :, None], corners.roll(-1, dims=1)[:, :, None]
    points = (starts + shares * (ends - starts)).flatten(0, 2)
    moved = integrate(lambda t, x: time * field(t, x), points, n_steps)
    return moved.reshape(len(corners), 3 * n_pieces, 2)


def crossing_figure(field: AnalyticField, gap: float, time: float, n_steps: int, pieces: tuple[int, ...]) -> Figure:
    """Two triangles moved for some time, a panel for every number of pieces that their sides are cut into.

    Dotted: where the flow takes the sides themselves.
    """
    corners = two_triangles(gap)
    curves = outlines(field, corners, time, n_steps, 64)
    size = (WIDTH, 1.3 * WIDTH / len(pieces))
    figure, axes = plt.subplots(1, len(pieces), figsize=size, layout="constrained", squeeze=False, sharey=True)
    for ax, n_pieces in zip(axes[0], pieces):
        moved = outlines(field, corners, time, n_steps, n_pieces)
        for straight, curve, colour in zip(moved.numpy(), curves.numpy(), (BLUE, ORANGE)):
            ax.fill(*straight.T, facecolor=(colour, 0.35), edgecolor=colour, linewidth=2)
            ax.plot(*np.vstack([curve, curve[:1]]).T, color="0.25", linewidth=1.2, linestyle=":")
        title = "corners only" if n_pieces == 1 else f"sides in {n_pieces} pieces"
        ax.set(title=title, xlabel="$x$ (units)", aspect="equal", xlim=(-1.6, 1.6), ylim=(-2.1, 1.5))
    axes[0, 0].set_ylabel("$y$ (units)")
    return figure


def crossing_player(description: str, gap: float = 0.3) -> Page:
    """Two triangles, a push or a whirl, and sliders for time, Euler steps, and the pieces of each side.

    A still picture comes first and stays where scripts may not run. Nothing moves unless the reader moves it. The page
    says how large h·L is and how many pairs of sides cross.

    Parameters
    ----------
    description : str
        What is to be seen, for those who do not see it.
    gap : float
        Height of the tip over the side below, as in :func:`two_triangles`.

    Raises
    ------
    ValueError
        If the gap is not in (0, 1).
    """
    fields = {}
    for name, field in FIELDS.items():
        reach = field.width if isinstance(field, Push) else field.radius
        fields[name] = {"strength": field.strength, "reach": reach, "lipschitz": float(field.lipschitz_bound())}
    data = {"corners": two_triangles(gap).tolist(), "fields": fields, "colours": [BLUE, ORANGE]}
    return live_page(
        "meshot_book/figures/assets/crossing_player",
        data,
        "CrossingPlayer(run the cell to move two triangles)",
        alt=description,
        still=still_of(crossing_figure(FIELDS["push"], gap, 0.6, 8, (1, 16))),
    )
