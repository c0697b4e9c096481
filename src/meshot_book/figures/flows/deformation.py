"""A surface on its way: an interactive view in which a reader moves through the time of a deformation, offline."""

from collections.abc import Mapping, Sequence

import numpy as np

from meshot.mesh import Mesh
from meshot.types import Array, Float, Tensor
from meshot.view import COLOUR_MAP, Page, interactive, live_page


def deformation_view(
    mesh: Mesh,
    paths: Mapping[str, Float[Tensor, "k V 3"]],
    times: Sequence[float],
    *,
    alt: str,
    values: Mapping[str, Float[Array, "k V"]] | None = None,
    beside: Mapping[str, Mesh] | None = None,
    label: str = "",
    unit: str = "mm",
    limits: tuple[float, float] | None = None,
    colour_map: str = COLOUR_MAP,
    view: str = "left",
) -> Page:
    """A surface that deforms, one deformation at a time, with a slider for the time, a button, and a still first.

    It starts at rest, with the end of the first deformation. The surface can be turned and zoomed at any time. The
    button plays about ten moments a second; two where a reader asks for reduced motion. Everything can be done by keys.
    Each moment takes about 3 bytes a face.

    Tag the cell ``nbval-ignore-output``, as for :func:`meshot.view.interactive`.

    Parameters
    ----------
    mesh : Mesh
        Whose faces are drawn.
    paths : mapping
        Name → where the vertices are at each of ``times``.
    times : sequence of float
        Rising.
    alt : str
        What is to be seen, for those who do not see it.
    values : mapping, optional
        Name → one number for each moment and vertex, coloured on one scale.
    beside : mapping, optional
        Surfaces that do not move, such as the target, to be chosen too.
    label, unit, limits, colour_map, view
        As :func:`meshot.view.interactive`.

    Raises
    ------
    ValueError
        If there is no path, a path or its values do not have one row for each time, the times do not rise, a name
        occurs twice, or as :func:`meshot.view.interactive`.
    RuntimeError
        If there is no OpenGL here to draw the still.
    """
    beside = dict(beside or {})
    _require_frames(mesh, paths, times, values or {}, beside)
    last = len(times) - 1
    meshes, shades, choices = {}, {}, []
    for name, places in paths.items():
        # The end comes first: what comes first is the still. What is stored twice takes no room.
        order = [last, *range(last)]
        start = len(meshes)
        for k in order:
            meshes[f"{name}, {times[k]:.4g}"] = mesh.with_vertices(places[k])
            if values and name in values:
                shades[f"{name}, {times[k]:.4g}"] = values[name][k]
        choices.append({"name": name, "items": [start + order.index(k) for k in range(len(times))]})
    for name, other in beside.items():
        choices.append({"name": name, "items": [len(meshes)]})
        meshes[name] = other
    options = {"label": label, "unit": unit, "limits": limits, "colour_map": colour_map, "view": view}
    scene = interactive(meshes, shades or None, alt=alt, **options)
    return live_page(
        "meshot_book/figures/assets/deformation",
        {"times": [float(t) for t in times], "choices": choices},
        f"Deformation({', '.join([*paths, *beside])}; {len(times)} frames; run the cell to see it move)",
        alt=alt,
        last=last,
        scene=scene.html,
    )


def _require_frames(mesh: Mesh, paths: Mapping, times: Sequence[float], values: Mapping, beside: Mapping) -> None:
    if not paths:
        raise ValueError("paths is empty; at least one deformation is needed")
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise ValueError(f"times are {list(times)}; two or more rising numbers are needed")
    twice = set(paths) & set(beside)
    if twice:
        raise ValueError(
            f"{', '.join(sorted(twice))} is the name of a deformation and of a surface beside it; rename one"
        )
    wanted = (len(times), len(mesh.vertices))
    for name, places in paths.items():
        if tuple(places.shape) != (*wanted, 3):
            raise ValueError(
                f"the path {name!r} has shape {tuple(places.shape)}; {(*wanted, 3)} is needed, a row a time"
            )
    for name, numbers in values.items():
        if name not in paths:
            raise ValueError(f"values are named {name!r}, which is none of the paths: {', '.join(paths)}")
        if tuple(numbers.shape) != wanted:
            raise ValueError(f"values {name!r} has shape {tuple(numbers.shape)}; {wanted} is needed, a row a time")
