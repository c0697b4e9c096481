"""Motion that a reader can stop: a small page with a slider, whole in itself, that needs no network."""

import base64
from collections.abc import Mapping, Sequence

import numpy as np

from meshot.mesh import Contour
from meshot.types import Float, Tensor
from meshot.view import BLACK, LOSS_COLOURS, Page, live_page, still_of
from meshot_book.figures.points.points import box_around, process_figure

LEVELS = 65535


def point_player(
    frames: Mapping[str, Float[Tensor, "k n 2"]], steps: Sequence[int], contour: Contour, description: str
) -> Page:
    """Points moving to a contour, a panel for every loss, with a slider, a button, and a still picture first.

    It starts at rest. Where a reader asks for reduced motion, frames change one by one instead of gliding. Without
    scripts the still picture stays.

    Parameters
    ----------
    frames : mapping
        Name of the loss → the points at each of ``steps``; positions are stored in 16 bits, far below a pixel.
    steps : sequence of int
        The moments, rising.
    contour : Contour
        The target, in grey.
    description : str
        What is to be seen, for those who do not see it.

    Raises
    ------
    ValueError
        If a loss does not have one frame for each step.
    """
    for name, points in frames.items():
        if len(points) != len(steps):
            raise ValueError(f"{name} has {len(points)} frames for {len(steps)} steps; one for each is needed")
    left, right, bottom, top = box_around(contour)
    corners = contour.vertices[contour.edges].detach().cpu().numpy().round(4).tolist()
    data = {
        "box": [left, right, bottom, top],
        "edges": corners,
        "steps": [int(step) for step in steps],
        "panels": [
            {
                "name": name,
                "colour": LOSS_COLOURS.get(name, BLACK),
                "points": _packed(points, (left, right, bottom, top)),
            }
            for name, points in frames.items()
        ],
    }
    still = {name: {int(steps[-1]): points[-1]} for name, points in frames.items()}
    return live_page(
        "meshot_book/figures/assets/point_player",
        data,
        f"Player({len(steps)} frames; run the cell to see it move)",
        alt=description,
        still=still_of(process_figure(still, contour)),
        last=len(steps) - 1,
    )


def _packed(points: Float[Tensor, "k n 2"], box: tuple[float, float, float, float]) -> str:
    """Positions in the box as little-endian 16-bit integers, base64."""
    low, size = np.array(box[::2]), np.array([box[1] - box[0], box[3] - box[2]])
    share = (points.detach().cpu().double().numpy() - low) / size
    return base64.b64encode(np.rint(share.clip(0, 1) * LEVELS).astype("<u2").tobytes()).decode()
