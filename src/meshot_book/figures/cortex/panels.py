"""One slice of several volumes side by side, at one scale, with the lines in which surfaces meet it."""

import itertools
from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from meshot.mesh import Mesh, plane_section
from meshot.view import LINE_COLOURS, PLANES, SKY, VERMILLION, WIDTH, slice_image
from meshot.volume import Volume


def slice_panels(
    volumes: Mapping[str, Volume],
    plane: str,
    position_mm: float,
    meshes: Mapping[str, Mapping[str, Mesh]] | None = None,
    limits: tuple[float, float] | None = None,
    label: str = "",
    colour_map: str = "gray",
    columns: int = 3,
) -> Figure:
    """The same plane through several volumes, in scanner mm, with one scale of grey for all.

    Parameters
    ----------
    volumes : mapping
        By title.
    plane : str
        "axial", "coronal" or "sagittal".
    position_mm : float
        Where the plane is.
    meshes : mapping, optional
        By title, surfaces by name, drawn over the volume of that title.
    limits : tuple, optional
        What is black and what is white; the extremes of all slices if left out.
    label : str
        Of the colour bar, with its unit; no bar if empty.
    colour_map : str
    columns : int
        Panels in a row.

    Raises
    ------
    ValueError
        If there is nothing to show, or the plane has another name.
    """
    if plane not in PLANES or not volumes:
        raise ValueError(f"plane is {plane!r}, of {len(volumes)} volumes; one of {', '.join(PLANES)}, and a volume")
    axis, shown, _ = PLANES[plane]
    slices = {name: slice_image(volume, axis, position_mm) for name, volume in volumes.items()}
    if limits is None:
        limits = tuple(float(f([f(image) for image, _ in slices.values()])) for f in (np.nanmin, np.nanmax))
    n_rows = -(-len(slices) // columns)
    extents = [extent for _, extent in slices.values()]
    ratio = max(top - bottom for *_, bottom, top in extents) / max(right - left for left, right, *_ in extents)
    width = WIDTH / columns
    size = (WIDTH, n_rows * ((width - 0.75) * ratio + 0.65) + 0.6)
    figure, axes = plt.subplots(n_rows, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.flat[len(slices) :]:
        ax.set_axis_off()
    for k, (ax, (name, (image, extent))) in enumerate(zip(axes.flat, slices.items())):
        drawn = ax.imshow(image, extent=extent, origin="lower", cmap=colour_map, vmin=limits[0], vmax=limits[1])
        ax.set_facecolor("black")
        ax.set_title(name)
        if k % columns == 0:
            ax.set_ylabel(f"{'xyz'[shown[1]]} (mm)")
        if k >= len(slices) - columns:
            ax.set_xlabel(f"{'xyz'[shown[0]]} (mm)")
        _draw_lines(ax, (meshes or {}).get(name, {}), axis, position_mm, shown)
    if meshes:
        named = {name: line for ax in axes.flat for line, name in zip(*ax.get_legend_handles_labels())}
        figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=len(named), frameon=False)
    if label:
        figure.colorbar(drawn, ax=axes, label=label, location="bottom", shrink=0.6, aspect=40)
    return figure


def _draw_lines(ax: Axes, meshes: Mapping[str, Mesh], axis: int, position: float, shown: tuple[int, int]) -> None:
    for (name, mesh), colour in zip(meshes.items(), itertools.cycle(LINE_COLOURS)):
        segments = plane_section(mesh, axis, position)[:, :, list(shown)].detach().cpu().numpy()
        ax.add_collection(LineCollection(segments, colors=colour, linewidths=1.0, label=name), autolim=False)


# One slice of a scan in several panels, each with the true surface and one found surface, and with marked places.

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
            colour, width = _LOOKS[label]
            segments = plane_section(each, axis, position_mm)[:, :, list(shown)].detach().cpu().numpy()
            line = LineCollection(segments, colors=colour, linewidths=width, label=label, capstyle="round")
            if label == "found":
                line.set_path_effects([withStroke(linewidth=width + 1.2, foreground="black")])
            ax.add_collection(line, autolim=False)
        for letter, place in (marks or {}).items():
            around = [withStroke(linewidth=3, foreground="black")]
            ax.text(*place, letter, color="white", ha="center", va="center", path_effects=around)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure
