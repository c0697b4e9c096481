"""A line that a reader turns: projections, sorted pairs and the cost by angle on a page whole in itself, offline."""

from meshot.errors import as_floating, require_shape
from meshot.types import Float, Tensor
from meshot.view import Page, live_page, still_of
from meshot_book.figures.lines.turning import ROWS, turning_figure

MOST_POINTS = 60


def turning_player(
    source: Float[Tensor, "n 2"], target: Float[Tensor, "n 2"], description: str, angle: int = 30
) -> Page:
    """Two clouds and a line to be turned by slider, keyboard or hand, with random lines to be drawn and averaged.

    A still picture comes first and stays where scripts may not run. Nothing moves unless the reader moves it; a reader
    who asks for reduced motion sees the line step instead of glide.

    Parameters
    ----------
    source, target : tensor
        Equally many points of equal mass, at most 60.
    description : str
        What is to be seen, for those who do not see it.
    angle : int
        Where the line starts, in degrees from 0 to 179.

    Raises
    ------
    ValueError
        If the clouds differ in size or are too large, the angle is out of range, or there is no description.
    """
    if not description.strip():
        raise ValueError("description is empty; say what is to be seen, for readers who do not see it")
    if angle not in range(180):
        raise ValueError(f"angle is {angle!r}; whole degrees from 0 to 179 are needed")
    clouds = {name: _places(points, name) for name, points in (("source", source), ("target", target))}
    sizes = {name: len(points) for name, points in clouds.items()}
    if sizes["source"] != sizes["target"] or sizes["source"] > MOST_POINTS:
        raise ValueError(f"the clouds have {sizes} points; equally many, at most {MOST_POINTS}, are needed")
    data = {name: points.tolist() for name, points in clouds.items()} | {"angle": angle, "rows": ROWS}
    return live_page(
        "meshot_book/figures/assets/turning",
        data,
        f"TurningPlayer({sizes['source']} points on either side; run the cell to turn the line)",
        alt=description,
        still=still_of(turning_figure(*clouds.values(), angle)),
    )


def _places(points: object, name: str) -> Tensor:
    points = as_floating(points, name)
    require_shape(points, name, 2)
    return points.detach().cpu().double()
