"""Interactive 3D views of surfaces in one piece of HTML: a static image first, the interactive view after a click."""

import base64
import io
import zlib
from collections.abc import Mapping

import matplotlib.colors
import matplotlib.image
import numpy as np
from matplotlib import colormaps
from matplotlib.ticker import MaxNLocator

from meshot.mesh import Mesh
from meshot.view.page import Page, live_page
from meshot.view.surface import (
    AMBIENT,
    COLOUR_MAP,
    PLAIN,
    Values,
    View,
    bar_label,
    colour_limits,
    framing,
    named,
    pointed_ends,
    surface_image,
    view_from,
)

STILL_SIZE = (880, 660)


def interactive(
    meshes: Mesh | Mapping[str, Mesh],
    values: Values | Mapping[str, Values] | None = None,
    *,
    alt: str,
    title: str = "",
    label: str = "",
    unit: str = "mm",
    limits: tuple[float, float] | None = None,
    colour_map: str = COLOUR_MAP,
    view: str = "left",
) -> Page:
    """An interactive view of one or several surfaces: rotated by dragging, zoomed by the wheel, selected by name.

    It needs no network and no other file, in notebooks and in the book. Positions are rounded to 1/16383 of the largest
    extent, values to 1/254 of the limits. The HTML has about 6 bytes per face, 3 more for each further mesh on the same
    faces, and 55 kB for the static image and the viewer: .18 MB for a surface of 20 000 faces with values.

    The static image depends on the machine's OpenGL and the data on its zlib. Tag the cell ``nbval-ignore-output``.

    Parameters
    ----------
    meshes : Mesh or mapping
        By name, if there are several; the first is shown first. A mesh may appear under several names with different
        values. It is stored once.
    values : array or mapping, optional
        One number per vertex, by the names of the meshes. NaN, and meshes without values, are drawn in a plain colour.
    alt : str
        A description for readers who cannot see the picture.
    title : str
        Shown above the picture.
    label, unit : str
        Quantity and unit of the values, for the colour bar.
    limits : tuple, optional
        The ends of the colour map. By default the range of the finite values.
    colour_map : str
        A colour map of matplotlib.
    view : str
        The initial direction of view, see :func:`meshot.view.surface_figure`.

    Raises
    ------
    ValueError
        If ``alt`` is empty, the values do not match the vertices, or the view is unknown.
    RuntimeError
        If there is no OpenGL to draw the static image.
    """
    if not alt.strip():
        raise ValueError("alt is empty; a description of the picture in a sentence is needed")
    meshes, values = named(meshes, values)
    limits = colour_limits(values, limits)
    sight = view_from(view)
    aspect = STILL_SIZE[0] / STILL_SIZE[1]
    first = next(iter(meshes))
    frame = framing(list(meshes.values()), [sight], aspect)
    image = surface_image(meshes[first], sight, values.get(first), limits, colour_map, STILL_SIZE, *frame)
    still = io.BytesIO()
    matplotlib.image.imsave(still, image, format="webp", pil_kwargs={"quality": 80})
    names = ", ".join(name for name in meshes if name) or "one surface"
    return live_page(
        "meshot/view/assets/surface_scene",
        scene_data(meshes, values, limits, colour_map, sight, aspect),
        f"Scene({names}; run the cell to turn it)",
        alt=alt,
        title=title,
        still=base64.b64encode(still.getvalue()).decode(),
        bar=_bar(values, limits, colour_map, bar_label(label, unit)) if values else None,
    )


def _bar(values: Mapping[str, np.ndarray], limits: tuple[float, float], colour_map: str, label: str) -> dict:
    low, high = limits
    slack = 1e-9 * (high - low)
    ends = pointed_ends(values, limits)
    beyond = {"neither": "", "min": f"below {low:g}", "max": f"above {high:g}", "both": f"beyond {low:g} and {high:g}"}
    label += f"; {beyond[ends]}: the colour of the end" if beyond[ends] else ""
    colours = [matplotlib.colors.to_hex(colour) for colour in colormaps[colour_map](np.linspace(0, 1, 17))]
    ticks = [
        (f"{100 * (tick - low) / (high - low):.4g}", f"{tick:g}".replace("-", "−"))
        for tick in MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
        if low - slack <= tick <= high + slack
    ]
    return {"label": label, "low": f"{low:g}", "high": f"{high:g}", "colours": colours, "ticks": ticks}


# Compression of surfaces for the interactive view.

# A resolution of 1/100 mm on a brain. Two more bits would cost 10 kB for a surface of 20 000 faces.
LEVELS = 2**14 - 1


def scene_data(
    meshes: Mapping[str, Mesh],
    values: Mapping[str, np.ndarray],
    limits: tuple[float, float],
    colour_map: str,
    view: View,
    aspect: float,
) -> dict:
    """The input of the viewer as JSON values, with all arrays packed into one string."""
    # Arrays are integers (vertices on a grid, corner indices, colour indices), mostly differences of neighbours. They
    # are zigzag-encoded, split into three planes of bytes, compressed together, and encoded in base64. Equal arrays are
    # stored once.
    centre, half_height = framing(list(meshes.values()), [view], aspect)
    places = {name: mesh.vertices.detach().cpu().double().numpy() - centre for name, mesh in meshes.items()}
    every = np.concatenate(list(places.values()))
    low, extent = every.min(axis=0), float(np.ptp(every, axis=0).max()) or 1.0
    arrays: dict[bytes, np.ndarray] = {}
    items = []
    for name, mesh in meshes.items():
        levels = np.rint((places[name] - low) / extent * LEVELS).astype(np.int64)
        first, second, third = mesh.faces.cpu().numpy().T
        item = {"name": name, "vertices": _store(arrays, np.diff(levels, axis=0, prepend=0).T.ravel())}
        corners = np.concatenate([np.diff(first, prepend=0), second - first, third - first])
        item |= {"faces": _store(arrays, corners), "values": -1}
        if name in values:  # colour indices 1 … 255 between the limits; 0 for NaN
            share = np.clip((values[name] - limits[0]) / (limits[1] - limits[0]), 0, 1)
            shades = np.where(np.isnan(share), 0, 1 + np.rint(np.nan_to_num(share) * 254))
            item["values"] = _store(arrays, shades)
        items.append(item)
    ramp = (colormaps[colour_map](np.arange(256) / 255) * 255).round().astype(np.uint8)
    return {
        "items": items,
        "lengths": [len(array) for array in arrays.values()],
        "packed": base64.b64encode(zlib.compress(b"".join(arrays), 9)).decode(),
        "low": low.tolist(),
        "step": extent / LEVELS,
        "half": half_height,
        "reach": float(np.linalg.norm(every, axis=1).max()) * 1.01 or 1.0,
        "turn": view.axes.tolist(),
        "plain": PLAIN,
        "ambient": AMBIENT,
        "colours": base64.b64encode(ramp.tobytes()).decode(),
    }


def _store(arrays: dict[bytes, np.ndarray], numbers: np.ndarray) -> int:
    """The index of an array of integers among those stored. Equal arrays share one index; the key is their bytes."""
    numbers = numbers.astype(np.int64)
    zigzag = (numbers << 1) ^ (numbers >> 63)
    planes = b"".join(((zigzag >> shift) & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))
    arrays.setdefault(planes, numbers)
    return list(arrays).index(planes)
