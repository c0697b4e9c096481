"""One slice of a scan in several panels, each with the true surface and one found surface, and with marked places."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from meshot.mesh import Mesh, plane_section
from meshot.view import PLANES, SKY, VERMILLION, WIDTH, slice_image
from meshot.volume import Volume

# The true line is thick, the found one thin with dark edges, so that both are told apart without colour.
_LOOKS = {"true": (SKY, 4.0), "found": (VERMILLION, 1.6)}


def compared_slices(
    volume: Volume,
    truth: Mesh,
    found: Mapping[str, Mesh],
    plane: str,
    position_mm: float,
    marks: Mapping[str, tuple[float, float]] | None = None,
    margin_mm: float = 3.0,
    columns: int = 2,
) -> Figure:
    """The true surface as a thick line and a found surface as a thin one, in one panel for each found surface.

    Parameters
    ----------
    volume : Volume
        The scan, in [0, 1].
    truth : Mesh
    found : mapping
        Surfaces by the title of their panel.
    plane : str
        "axial", "coronal" or "sagittal".
    position_mm : float
        The position of the plane.
    marks : mapping, optional
        Places in the plane, in mm, by a letter that is written there.
    margin_mm : float
        How much is shown around the true surface.
    columns : int
        Panels in a row.

    Raises
    ------
    ValueError
        If there is no found surface, or the plane is unknown.
    """
    if plane not in PLANES or not found:
        raise ValueError(f"plane is {plane!r}, of {len(found)} surfaces; one of {', '.join(PLANES)}, and a surface")
    axis, shown, _ = PLANES[plane]
    image, extent = slice_image(volume, axis, position_mm)
    ends = truth.vertices[:, list(shown)].detach().cpu().numpy()
    (left, bottom), (right, top) = ends.min(axis=0) - margin_mm, ends.max(axis=0) + margin_mm
    n_rows, ratio = -(-len(found) // columns), (top - bottom) / (right - left)
    size = (WIDTH, n_rows * ((WIDTH / columns - 0.5) * ratio + 0.55) + 0.9)
    figure, axes = plt.subplots(n_rows, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.flat[len(found) :]:
        ax.set_axis_off()
    for k, (ax, (name, mesh)) in enumerate(zip(axes.flat, found.items())):
        ax.imshow(image, extent=extent, origin="lower", cmap="gray", vmin=0, vmax=1)
        ax.set(title=name, xlim=(left, right), ylim=(bottom, top))
        if k % columns == 0:
            ax.set_ylabel(f"{'xyz'[shown[1]]} (mm)")
        if k >= len(found) - columns:
            ax.set_xlabel(f"{'xyz'[shown[0]]} (mm)")
        for label, each in (("true", truth), ("found", mesh)):
            _draw_line(ax, label, plane_section(each, axis, position_mm)[:, :, list(shown)].detach().cpu().numpy())
        for letter, place in (marks or {}).items():
            around = [withStroke(linewidth=3, foreground="black")]
            ax.text(*place, letter, color="white", ha="center", va="center", path_effects=around)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _draw_line(ax: Axes, label: str, segments: object) -> None:
    colour, width = _LOOKS[label]
    line = LineCollection(segments, colors=colour, linewidths=width, label=label, capstyle="round")
    if label == "found":
        line.set_path_effects([withStroke(linewidth=width + 1.2, foreground="black")])
    ax.add_collection(line, autolim=False)
