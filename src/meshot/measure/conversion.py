"""What a loss is given made a measure: the one place where meshes and arrays are converted."""

import numpy as np

from meshot.errors import as_floating, require_same_space, require_shape
from meshot.measure.continuous import surface
from meshot.measure.discrete import DiscreteMeasure, varifold
from meshot.measure.protocol import Measure
from meshot.mesh import Contour, Mesh
from meshot.types import Array, Float, Tensor

#: What a loss takes for either of its two measures.
MeasureLike = Measure | Mesh | Contour | Float[Tensor, "_ _"] | Float[Array, "_ _"]
#: First word of a class's module -> how its meshes become ours.
_FOREIGN = {"trimesh": "Mesh.from_trimesh(...)", "pyvista": "Mesh.from_pyvista(...)"}


def as_measures(source: MeasureLike, target: MeasureLike) -> tuple[Measure, Measure]:
    """Both sides of a loss as measures in the same space.

    A measure stays as it is. A :class:`meshot.Mesh` or :class:`meshot.Contour` becomes its continuous measure,
    uniform by area or length. A matrix of floating-point numbers, as an array or a tensor, becomes points of equal
    weight, one for each row; a tensor keeps its gradient.

    Raises
    ------
    ValueError
        If either is something else, or the two differ in dimension, dtype or device.
    """
    return _in_one_space(_measure(source, "source"), _measure(target, "target"))


def as_point_measures(source: MeasureLike, target: MeasureLike) -> tuple[Measure, Measure]:
    """Both sides of a loss that compares points, in the same space.

    As :func:`as_measures`, but a mesh becomes the barycentres of its faces, weighted by area (a contour the midpoints
    of its edges, by length): the positions of its varifold.

    Raises
    ------
    ValueError
        As :func:`as_measures`, and for a continuous measure, which has no points.
    """
    return _in_one_space(_point_measure(source, "source"), _point_measure(target, "target"))


def _measure(value: object, name: str) -> Measure:
    if isinstance(value, Measure):
        return value
    if isinstance(value, Mesh | Contour):
        return surface(value)
    if not isinstance(value, Tensor | np.ndarray):
        raise ValueError(f"{name} is {_described(value)}; {_remedy(value)}")
    points = as_floating(value, name)
    require_shape(points, name, None)
    return DiscreteMeasure(points)


def _point_measure(value: object, name: str) -> Measure:
    if isinstance(value, Mesh | Contour):
        return varifold(value)
    measure = _measure(value, name)
    if measure.cells is not None:
        raise ValueError(
            f"{name} is a continuous measure, {value!r}; this loss compares points: draw them by "
            "meshot.empirical(mesh, n_points, generator=0), or pass the Mesh itself for the barycentres of its faces"
        )
    return measure


def _in_one_space(source: Measure, target: Measure) -> tuple[Measure, Measure]:
    require_same_space(source.places, target.places)
    return source, target


def _described(value: object) -> str:
    kind = type(value)
    name = (
        kind.__qualname__ if kind.__module__ == "builtins" else f"{kind.__module__.split('.')[0]}.{kind.__qualname__}"
    )
    return repr(value) if value is None or isinstance(value, bool | int | float | complex | str) else f"a {name}"


def _remedy(value: object) -> str:
    """How something that is no measure becomes one."""
    accepted = "a measure, a Mesh, a Contour, or an (n, d) array or tensor of floating-point numbers is needed"
    foreign = _FOREIGN.get(type(value).__module__.split(".")[0])
    if foreign:
        return f"{accepted}: convert it by {foreign}"
    if isinstance(value, list | tuple):
        return f"{accepted}: convert points by torch.tensor(...), or vertices and faces by Mesh(vertices, faces)"
    return f"{accepted}: points go into numpy.asarray(..., dtype=float), a triangle mesh into Mesh(vertices, faces)"
