"""Static pictures of surfaces: shaded, coloured by values at the vertices, to scale."""

import dataclasses
import itertools
import warnings
from collections.abc import Mapping, Sequence
from types import ModuleType

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from meshot.errors import require_positive_integer
from meshot.extras import needing
from meshot.mesh import Mesh
from meshot.types import Array, Float
from meshot.view.display import require_display

# Directions of view. World axes are scanner RAS: +x is right, +y anterior, +z superior.

# Direction from the surface to the camera, and the upward direction of the picture.
_EYES = {
    "left": ((-1, 0, 0), (0, 0, 1)),
    "right": ((1, 0, 0), (0, 0, 1)),
    "anterior": ((0, 1, 0), (0, 0, 1)),
    "posterior": ((0, -1, 0), (0, 0, 1)),
    "superior": ((0, 0, 1), (0, 1, 0)),
    "inferior": ((0, 0, -1), (0, 1, 0)),
}
_SIDES = {("lateral", "left"): "left", ("lateral", "right"): "right"}
_SIDES |= {("medial", "left"): "right", ("medial", "right"): "left"}
_LETTERS = ("LR", "PA", "IS")


@dataclasses.dataclass(frozen=True, eq=False)
class View:
    """A direction of view."""

    name: str  # as requested, such as "lateral"
    axes: Float[Array, "3 3"]  # orthonormal rows: right and up in the picture, and towards the camera

    def letters(self) -> tuple[str, str, str, str]:
        """The anatomical letters at the left, right, bottom and top edges of the picture, such as A, P, I, S."""
        letters = []
        for row in self.axes[:2]:
            axis = int(np.abs(row).argmax())
            ends = _LETTERS[axis]
            letters += list(ends if row[axis] > 0 else ends[::-1])
        return tuple(letters)


def view_from(name: str, hemisphere: str | None = None) -> View:
    """The view with a name."""
    if name in ("lateral", "medial") and hemisphere not in ("left", "right"):
        raise ValueError(f"view is {name!r} and hemisphere {hemisphere!r}; say hemisphere='left' or 'right'")
    direction = _SIDES.get((name, hemisphere), name)
    if direction not in _EYES:
        raise ValueError(f"view is {name!r}; one of {', '.join([*_EYES, 'lateral', 'medial'])} is needed")
    towards, up = (np.array(axis, dtype=float) for axis in _EYES[direction])
    return View(name, np.stack([np.cross(up, towards), up, towards]))


# Validation of values at the vertices of surfaces, and their colour limits.

COLOUR_MAP = "viridis"
Values = Sequence[float] | np.ndarray | torch.Tensor


def named(
    meshes: Mesh | Mapping[str, Mesh], values: Values | Mapping[str, Values] | None
) -> tuple[dict[str, Mesh], dict[str, np.ndarray]]:
    """Meshes and their values by name, with values as float64 arrays. A single mesh has the empty name."""
    if isinstance(meshes, Mesh):
        meshes, values = {"": meshes}, None if values is None else {"": values}
    if not meshes:
        raise ValueError("meshes is empty; at least one mesh is needed")
    if values is not None and not isinstance(values, Mapping):
        raise ValueError(f"values is a {type(values).__name__} for several meshes; a mapping by their names is needed")
    found = {}
    for name, numbers in (values or {}).items():
        if name not in meshes:
            raise ValueError(f"values are named {name!r}, which is none of the meshes: {', '.join(meshes)}")
        numbers = numbers.detach().cpu().numpy() if isinstance(numbers, torch.Tensor) else numbers
        found[name], n = np.asarray(numbers, dtype=np.float64), len(meshes[name].vertices)
        if found[name].shape != (n,):
            raise ValueError(f"values {name!r} has shape {found[name].shape}; ({n},) is needed, one for each vertex")
        if not np.isfinite(found[name]).any():
            raise ValueError(f"values {name!r} has no finite entry; leave it out to draw the mesh plain")
    return dict(meshes), found


def colour_limits(values: Mapping[str, np.ndarray], limits: tuple[float, float] | None) -> tuple[float, float]:
    """The values at the ends of the colour map: as given, or the range of all finite values."""
    if limits is not None:
        if not (np.isfinite(limits).all() and limits[0] < limits[1]):
            raise ValueError(f"limits are {limits!r}; two finite, increasing numbers are needed")
        return float(limits[0]), float(limits[1])
    if not values:
        return 0.0, 1.0
    every = np.concatenate(list(values.values()))
    low, high = float(np.min(every[np.isfinite(every)])), float(np.max(every[np.isfinite(every)]))
    # If all values are equal, the colour bar still needs a positive length.
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def pointed_ends(values: Mapping[str, np.ndarray], limits: tuple[float, float]) -> str:
    """Which ends of the colour bar have values beyond them: "neither", "min", "max" or "both"."""
    every = np.concatenate(list(values.values()))
    below, above = bool((every < limits[0]).any()), bool((every > limits[1]).any())
    return {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[below, above]


def bar_label(label: str, unit: str) -> str:
    """The label of a colour bar: the quantity, and its unit in parentheses."""
    return f"{label} ({unit})" if label and unit else label or unit


PLAIN = (0.80, 0.79, 0.76)
AMBIENT, DIFFUSE = 0.3, 0.7
# In points. Text is never smaller, and larger where matplotlib's default is.
LEAST_TEXT = 12.0


def surface_image(
    mesh: Mesh,
    view: View,
    values: Values | None = None,
    limits: tuple[float, float] = (0.0, 1.0),
    colour_map: str = COLOUR_MAP,
    size: tuple[int, int] = (600, 450),
    centre: Float[Array, " 3"] | None = None,
    half_height: float | None = None,
) -> np.ndarray:
    """A picture of a surface in parallel projection, on a transparent background."""
    pyvista = _drawing_library()
    if centre is None or half_height is None:
        centre, half_height = framing([mesh], [view], size[0] / size[1])
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="none")
    try:
        plotter.add_light(pyvista.Light(light_type="headlight"))
        vertices = mesh.vertices.detach().cpu().numpy()
        polygons = pyvista.PolyData.from_regular_faces(vertices, mesh.faces.cpu().numpy())
        colouring = {"color": PLAIN}
        if values is not None:
            polygons["values"] = np.asarray(values, dtype=float)
            colouring = {"scalars": "values", "clim": limits, "cmap": colour_map, "nan_color": PLAIN}
            colouring |= {"show_scalar_bar": False, "interpolate_before_map": True}
        shading = {"smooth_shading": True, "ambient": AMBIENT, "diffuse": DIFFUSE, "specular": 0.0}
        plotter.add_mesh(polygons, **shading, **colouring)
        plotter.enable_anti_aliasing("ssaa")
        _, up, towards = view.axes
        distance = 10 * half_height
        plotter.camera_position = [centre + distance * towards, centre, up]
        plotter.enable_parallel_projection()
        plotter.camera.parallel_scale = half_height
        plotter.camera.clipping_range = (0.1 * distance, 2 * distance)
        return plotter.screenshot(transparent_background=True, return_img=True)
    finally:
        plotter.close()


def _drawing_library() -> ModuleType:
    """The module pyvista, after a check that VTK will not crash."""
    require_display()
    with warnings.catch_warnings():
        # In a notebook, tqdm (imported by pyvista) warns about missing widgets that are not used here.
        warnings.filterwarnings("ignore", message="IProgress not found")
        with needing("cortex"):
            import pyvista
    return pyvista


def framing(meshes: Sequence[Mesh], views: Sequence[View], aspect: float) -> tuple[Float[Array, " 3"], float]:
    """The centre and the half height with which all meshes are completely visible in all views, with a small margin."""
    # ``aspect`` is width divided by height.
    vertices = np.concatenate([mesh.vertices.detach().cpu().double().numpy() for mesh in meshes])
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    reach = [np.abs((vertices - centre) @ view.axes[:2].T).max(axis=0) for view in views]
    return centre, 1.1 * max(max(height, width / aspect) for width, height in reach)


def surface_figure(
    meshes: Mesh | Mapping[str, Mesh],
    values: Values | Mapping[str, Values] | None = None,
    views: Sequence[str] = ("left", "right"),
    hemisphere: str | Mapping[str, str] | None = None,
    label: str = "",
    unit: str = "mm",
    limits: tuple[float, float] | None = None,
    colour_map: str = COLOUR_MAP,
    panel_inches: tuple[float, float] = (3.2, 2.4),
    resolution: int = 150,
    length_unit: str = "mm",
    abreast: int = 1,
) -> Figure:
    """A figure of one or several surfaces, with a row per surface and a column per view, all at the same scale.

    Parameters
    ----------
    meshes : Mesh or mapping
        By name, if there are several.
    values : array or mapping, optional
        One number per vertex, by the names of the meshes. Meshes without values are drawn in a plain colour.
    views : sequence of str
        Positions of the camera: "left", "right", "anterior", "posterior", "superior" or "inferior"; for a hemisphere of
        a brain also "lateral" (from outside) or "medial" (from the other hemisphere).
    hemisphere : str or mapping, optional
        "left" or "right", for all meshes or by name. Required for "lateral" and "medial". Letters then show the
        orientation.
    label, unit : str
        Quantity and unit of the values, for the colour bar.
    limits : tuple, optional
        The ends of the colour map. By default the range of the finite values. Values outside are drawn in the colour of
        the nearest end, and this end of the bar is pointed.
    colour_map : str
        A colour map of matplotlib.
    panel_inches : tuple
        Width and height of one picture.
    resolution : int
        Pixels per inch.
    length_unit : str
        The unit of the vertices, for the scale bar.
    abreast : int
        Number of surfaces in a row. With a single view, the titles then do not repeat its name.

    Raises
    ------
    ValueError
        If the values do not match the vertices, a view is unknown, or ``abreast`` is not a positive integer.
    RuntimeError
        If there is no OpenGL.
    """
    require_positive_integer(abreast, "abreast")
    meshes, values = named(meshes, values)
    limits = colour_limits(values, limits)
    sides = hemisphere if isinstance(hemisphere, Mapping) else dict.fromkeys(meshes, hemisphere)
    sights = {name: [view_from(view, sides.get(name)) for view in views] for name in meshes}
    every_view = list(itertools.chain(*sights.values()))
    centre, half_height = framing(list(meshes.values()), every_view, panel_inches[0] / panel_inches[1])
    size = tuple(round(inches * resolution) for inches in panel_inches)
    n_rows = -(-len(meshes) // abreast)
    n_columns = abreast * len(views)
    titles, bar_inches = 0.3 * n_rows, 0.75 * bool(values)
    inches = panel_inches[0] * n_columns, panel_inches[1] * n_rows + titles + bar_inches
    options = {"squeeze": False, "facecolor": "white", "layout": "constrained"}
    figure, axes = plt.subplots(n_rows, n_columns, figsize=inches, dpi=resolution, **options)
    for (name, mesh), line in zip(meshes.items(), axes.reshape(n_rows * abreast, len(views))):
        for view, ax in zip(sights[name], line):
            image = surface_image(mesh, view, values.get(name), limits, colour_map, size, centre, half_height)
            half_width = half_height * image.shape[1] / image.shape[0]
            ax.imshow(image, extent=(-half_width, half_width, -half_height, half_height))
            ax.set_axis_off()
            letters = view.letters() if sides.get(name) else ()
            draw_letters(ax, letters, 0.01, fontsize=_text_points(), color="0.3")
            words = [name, view.name if abreast == 1 or len(views) > 1 or not name else ""]
            ax.set_title(", ".join(filter(None, words)), fontsize=_text_points())
    for ax in axes.flat[len(meshes) * len(views) :]:
        ax.set_axis_off()
    # A scale bar of a round length at the lower right, at most half of the half height.
    ax, magnitude = axes[-1, 0], 10.0 ** np.floor(np.log10(half_height / 2))
    length = magnitude * max(step for step in (1, 2, 5) if step * magnitude <= half_height / 2)
    right, bottom = ax.get_xlim()[1], -0.97 * half_height
    ax.plot([0.97 * right - length, 0.97 * right], [bottom, bottom], color="0.2", linewidth=2, solid_capstyle="butt")
    place = 0.97 * right - length / 2, bottom + 0.03 * half_height
    text = f"{length:g} {length_unit}".strip()
    ax.text(*place, text, ha="center", va="bottom", fontsize=_text_points())
    if values:
        colours = ScalarMappable(Normalize(*limits), colour_map)
        options = {"extend": pointed_ends(values, limits), "location": "bottom", "aspect": 40, "shrink": 0.6}
        figure.colorbar(colours, ax=axes, label=bar_label(label, unit), **options)
    return figure


def _text_points() -> float:
    return max(LEAST_TEXT, plt.rcParams["font.size"])


def draw_letters(ax: Axes, letters: Sequence[str], inset: float, **text: object) -> None:
    """Write the letters of the orientation at the left, right, bottom and top of a picture."""
    places = [(inset, 0.5), (1 - inset, 0.5), (0.5, inset), (0.5, 1 - inset)]
    sides = [("left", "center"), ("right", "center"), ("center", "bottom"), ("center", "top")]
    for letter, place, (across, along) in zip(letters, places, sides):
        ax.text(*place, letter, transform=ax.transAxes, ha=across, va=along, **text)
