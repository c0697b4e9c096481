"""Slices of a volume, with the outlines of surfaces, in mm."""

import io
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from meshot.mesh import Mesh, plane_section
from meshot.types import Array, Float
from meshot.view.style import GREEN, ORANGE, PURPLE, SKY, VERMILLION, WIDTH, YELLOW
from meshot.view.surface import Values, draw_letters
from meshot.volume import Volume, mm_to_voxel, sample_volume, voxel_sizes, voxel_to_mm

# Colours that are visible on a grey image, the most distinct first.
LINE_COLOURS = (VERMILLION, SKY, GREEN, YELLOW, PURPLE, ORANGE)
# Two or three lines also differ in width, so that all are seen where they coincide; not where they cannot.
LINE_WIDTHS = {2: (2.8, 1.4), 3: (3.6, 2.4, 1.2)}
# The axis across the slice, the axes of the picture, and the letters at its left, right, bottom and top.
PLANES = {
    "axial": (2, (0, 1), ("L", "R", "P", "A")),
    "coronal": (1, (0, 2), ("L", "R", "I", "S")),
    "sagittal": (0, (1, 2), ("P", "A", "I", "S")),
}
# Where three planes stand: panels in a column share their horizontal axis, panels in the upper row their vertical one.
CELLS = {"coronal": (0, 0), "sagittal": (0, 1), "axial": (1, 0)}


def slice_image(
    volume: Volume, axis: int, position_mm: float, spacing: float | None = None
) -> tuple[Float[Array, "rows columns"], tuple[float, float, float, float]]:
    """The volume on the plane where world coordinate ``axis`` equals ``position_mm``, and its extent in mm.

    The plane is in scanner coordinates, for any orientation of the voxels, which are interpolated linearly: axis 0 is
    sagittal, 1 coronal, 2 axial. Outside the volume the image is NaN. ``spacing`` is the size of the pixels in mm, by
    default the smallest voxel side. The first row of pixels is at the bottom, and the extent is (left, right, bottom,
    top), the outer edges of the border.
    """
    spacing = float(voxel_sizes(volume).min()) if spacing is None else spacing
    low, high = _world_box(volume)
    across, along = (i for i in range(3) if i != axis)
    columns, rows = (low[i] + spacing * np.arange(int((high[i] - low[i]) / spacing + 1.5)) for i in (across, along))
    points = np.empty((len(rows), len(columns), 3))
    points[..., axis], points[..., across], points[..., along] = position_mm, columns, rows[:, None]
    points = torch.from_numpy(points.reshape(-1, 3))
    places = mm_to_voxel(volume, points)
    last = torch.tensor(volume.data.shape) - 1
    inside = ((places > -1e-6) & (places < last + 1e-6)).all(dim=1)
    values = sample_volume(volume, points).where(inside, points.new_tensor(torch.nan))
    half = spacing / 2
    extent = (columns[0] - half, columns[-1] + half, rows[0] - half, rows[-1] + half)
    return values.reshape(len(rows), len(columns)).numpy(), tuple(float(edge) for edge in extent)


def _world_box(volume: Volume) -> tuple[np.ndarray, np.ndarray]:
    corners = torch.tensor(list(np.ndindex(2, 2, 2)), dtype=torch.float64) * (torch.tensor(volume.data.shape) - 1)
    corners_mm = voxel_to_mm(volume, corners).numpy()
    return corners_mm.min(axis=0), corners_mm.max(axis=0)


def slice_figure(
    volume: Volume,
    meshes: Mapping[str, Mesh] | None = None,
    through_mm: Values | None = None,
    planes: Sequence[str] = ("axial", "coronal", "sagittal"),
    limits: tuple[float, float] | None = None,
    width_inches: float = WIDTH,
    margin_mm: float | None = None,
) -> Figure:
    """Slices through one point, with the outlines of surfaces. The right side of the subject is on the right.

    Three planes are drawn in two rows, coronal and sagittal above axial. One or two are drawn side by side.

    Parameters
    ----------
    volume : Volume
    meshes : mapping, optional
        Surfaces by name, in scanner RAS, in mm. The names are shown in the legend.
    through_mm : three numbers, optional
        The point, in scanner RAS. By default the centre of the surfaces, or of the volume.
    planes : sequence of str
        Any of "axial", "coronal" and "sagittal".
    limits : tuple, optional
        The values shown in black and in white. By default the 1st and the 99th percentile.
    width_inches : float
        Width of the figure.
    margin_mm : float, optional
        Show only the box around the surfaces, enlarged by this margin on each side. By default the whole volume.

    Raises
    ------
    ValueError
        If a plane is unknown or occurs twice, the point lies outside the volume, or the margin is negative or given
        without surfaces.
    """
    if not planes or len(set(planes) & set(PLANES)) != len(planes):
        raise ValueError(f"planes are {list(planes)}; one or more of {', '.join(PLANES)} are needed, each once")
    if margin_mm is not None and not (meshes and margin_mm >= 0):
        raise ValueError(
            f"margin_mm is {margin_mm!r} with {len(meshes or {})} surfaces; a number >= 0 and a surface are needed"
        )
    meshes = meshes or {}
    middle = np.mean(_box(meshes) if meshes else _world_box(volume), axis=0)
    through = middle if through_mm is None else np.asarray(through_mm, dtype=float)
    low, high = _world_box(volume)
    if through.shape != (3,) or (through < low).any() or (through > high).any():
        raise ValueError(
            f"through_mm is {through.tolist()}; a point in the volume is needed: between {low.round(1).tolist()} and "
            f"{high.round(1).tolist()} in scanner RAS"
        )
    black, white = np.percentile(volume.data, [1, 99]) if limits is None else limits
    slices = [slice_image(volume, PLANES[plane][0], float(through[PLANES[plane][0]])) for plane in planes]
    windows = [extent for _, extent in slices]
    if margin_mm is not None:  # the box around the surfaces with a margin
        low, high = _box(meshes)
        for k, plane in enumerate(planes):
            shown, (left, right, bottom, top) = list(PLANES[plane][1]), windows[k]
            (x_low, y_low), (x_high, y_high) = low[shown] - margin_mm, high[shown] + margin_mm
            windows[k] = max(x_low, left), min(x_high, right), max(y_low, bottom), min(y_high, top)
    figure, axes = _panels(planes, windows, width_inches)
    for plane, ax, window, (image, extent) in zip(planes, axes, windows, slices):
        axis, shown, letters = PLANES[plane]
        position = float(through[axis])
        ax.imshow(image, extent=extent, origin="lower", cmap="gray", vmin=black, vmax=white)
        widths = itertools.cycle((1.2,) if _are_apart(meshes) else LINE_WIDTHS.get(len(meshes), (1.2,)))
        for (name, mesh), colour, line in zip(meshes.items(), itertools.cycle(LINE_COLOURS), widths):
            segments = plane_section(mesh, axis, position)[:, :, list(shown)].detach().cpu().numpy()
            lines = LineCollection(segments, colors=colour, linewidths=line, label=name, capstyle="round")
            ax.add_collection(lines, autolim=False)  # the limits are those of the volume
        ax.set(xlim=window[:2], ylim=window[2:])
        ax.set_title(f"{plane}\n{'xyz'[axis]} = {position:.1f} mm".replace("-", "−"), fontsize="medium")
        ax.set(xlabel=f"{'xyz'[shown[0]]} (mm)", ylabel=f"{'xyz'[shown[1]]} (mm)")
        effects = [withStroke(linewidth=3, foreground="black")]
        draw_letters(ax, letters, 0.02, color="white", fontweight="bold", path_effects=effects)
    if len(axes) == len(CELLS):  # axes that two panels share are labelled once
        for plane, name, labels in (("coronal", "xlabel", "labelbottom"), ("sagittal", "ylabel", "labelleft")):
            axes[planes.index(plane)].set(**{name: ""})
            axes[planes.index(plane)].tick_params(**{labels: False})
    if meshes:  # the names of the surfaces: in the free place beside three panels, or below one or two
        handles, names = axes[0].get_legend_handles_labels()
        places = {"loc": "outside lower center", "ncols": len(names)}
        if len(axes) == len(CELLS):
            places = {"loc": "center", "bbox_to_anchor": (0.75, 0.25)}
        figure.legend(handles, names, frameon=False, **places)
    return figure


def _panels(planes: Sequence[str], windows: Sequence[tuple], width_inches: float) -> tuple[Figure, list[Axes]]:
    """Axes with sides in proportion to what they show, so that all have the same scale."""
    cells = [CELLS[plane] for plane in planes] if len(planes) == len(CELLS) else [(0, k) for k in range(len(planes))]
    rows, columns = (1 + max(cell[i] for cell in cells) for i in (0, 1))
    widths, heights = np.zeros(columns), np.zeros(rows)
    for (row, column), (left, right, bottom, top) in zip(cells, windows):
        widths[column] = max(widths[column], right - left)
        heights[row] = max(heights[row], top - bottom)
    if rows == 1:  # The labels of an axis need about .8 inch in each direction.
        free, labels = width_inches - 0.8 * columns, 1.2
    else:  # Titles of two lines and labels need the height of some lines of text.
        line = 1.25 * plt.rcParams["font.size"] / 72
        free, labels = width_inches - 5.0 * line, 4.3 * line * rows
    height = free * heights.sum() / widths.sum() + labels
    figure = plt.figure(figsize=(width_inches, height), layout="constrained")
    grid = figure.add_gridspec(rows, columns, width_ratios=widths, height_ratios=heights)
    return figure, [figure.add_subplot(grid[cell], facecolor="black") for cell in cells]


def _box(meshes: Mapping[str, Mesh]) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and the highest coordinates of all surfaces, in mm."""
    vertices = np.concatenate([mesh.vertices.detach().cpu().double().numpy() for mesh in meshes.values()])
    return vertices.min(axis=0), vertices.max(axis=0)


def _are_apart(meshes: Mapping[str, Mesh]) -> bool:
    """Whether the boxes of any two surfaces share less than half of the smaller one, as those of two hemispheres."""
    boxes = [_box({name: mesh}) for name, mesh in meshes.items()]
    for (low, high), (other_low, other_high) in itertools.combinations(boxes, 2):
        shared = np.maximum(np.minimum(high, other_high) - np.maximum(low, other_low), 0)
        if shared.prod() >= 0.5 * min((high - low).prod(), (other_high - other_low).prod()):
            return False
    return True


# One small picture of several slices with outlines and no labels, to look at many subjects at once.

_PIXELS = 240
_QUALITY = 70


class Cut(NamedTuple):
    """A slice: a volume that holds it, the name of its plane, and its position on the axis across the plane, in mm."""

    volume: Volume
    plane: str
    position: float


def slice_sheet(
    cuts: Sequence[Cut], mesh: Mesh, limits: tuple[float, float], colour: str = LINE_COLOURS[0], columns: int = 3
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
