"""One small picture of several slices with outlines and no labels, to look at many subjects at once."""

import io
from collections.abc import Sequence
from typing import NamedTuple

import matplotlib.pyplot as plt
from matplotlib.collections import LineCollection

from meshot.mesh import Mesh
from meshot.mesh.geometry import plane_section
from meshot.view.slices import LINE_COLOURS, PLANES, slice_image
from meshot.volume import Volume

_PIXELS = 240
_QUALITY = 70


class Cut(NamedTuple):
    """A slice: a volume that holds it, the name of its plane, and its position on the axis across the plane, in mm."""

    volume: Volume
    plane: str
    position: float


def slice_sheet(
    cuts: Sequence[Cut],
    mesh: Mesh,
    limits: tuple[float, float],
    colour: str = LINE_COLOURS[0],
    columns: int = 3,
) -> bytes:
    """Slices side by side, each in a square of 240 pixels, as a WebP file. The right of the subject is on the right.

    Every square has the same scale: the largest extent of all slices fills a square. Outside a volume the picture is
    black.

    Parameters
    ----------
    cuts : sequence of Cut
        From left to right, then down.
    mesh : Mesh
        Its outline is drawn on every slice. In scanner RAS, in mm.
    limits : tuple
        The values shown in black and in white.
    colour : str
        Of the outline.
    columns : int
        Number of squares in a row.

    Raises
    ------
    ValueError
        If there are no slices, or a plane is unknown.
    """
    unknown = [cut.plane for cut in cuts if cut.plane not in PLANES]
    if unknown or not cuts:
        raise ValueError(
            f"cuts have the planes {[cut.plane for cut in cuts]}; one or more of {', '.join(PLANES)} are needed"
        )
    images = [slice_image(cut.volume, PLANES[cut.plane][0], cut.position) for cut in cuts]
    half = max(max(right - left, top - bottom) for _, (left, right, bottom, top) in images) / 2
    rows = -(-len(cuts) // columns)
    figure = plt.figure(figsize=(columns, rows), dpi=_PIXELS, facecolor="black")
    for place, (cut, (image, extent)) in enumerate(zip(cuts, images, strict=True)):
        axis, shown, _ = PLANES[cut.plane]
        ax = figure.add_axes((place % columns / columns, 1 - (place // columns + 1) / rows, 1 / columns, 1 / rows))
        ax.set_axis_off()
        ax.imshow(image, extent=extent, origin="lower", cmap="gray", vmin=limits[0], vmax=limits[1])
        segments = plane_section(mesh, axis, cut.position)[:, :, list(shown)].detach().cpu().numpy()
        ax.add_collection(LineCollection(segments, colors=colour, linewidths=0.5, capstyle="round"), autolim=False)
        middle = (extent[0] + extent[1]) / 2, (extent[2] + extent[3]) / 2
        ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="webp", dpi=_PIXELS, pil_kwargs={"quality": _QUALITY})
    plt.close(figure)
    return buffer.getvalue()
