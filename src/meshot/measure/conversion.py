"""Conversion of the arguments of a loss to measures."""

import numpy as np

from meshot.errors import as_floating, require_same_space, require_shape
from meshot.measure.continuous import surface
from meshot.measure.discrete import DiscreteMeasure, varifold
from meshot.measure.protocol import Measure
from meshot.mesh import Contour, Mesh
from meshot.types import Array, Float, Tensor

#: The types that a loss accepts for each of its two measures.
MeasureLike = Measure | Mesh | Contour | Float[Tensor, "_ _"] | Float[Array, "_ _"]
#: For meshes of other packages, by the first part of the module name: how to convert them.
_FOREIGN = {"trimesh": "Mesh.from_trimesh(...)", "pyvista": "Mesh.from_pyvista(...)"}


def as_measures(source: MeasureLike, target: MeasureLike) -> tuple[Measure, Measure]:
    """Convert both arguments of a loss to measures in the same space.

    A measure is not changed. A :class:`meshot.Mesh` or :class:`meshot.Contour` becomes its continuous measure, uniform
    by area or length. A matrix of floating-point numbers, as an array or a tensor, becomes points of equal weight, one
    per row. A tensor keeps its gradient.

    Raises
    ------
    ValueError
        If an argument is of another type, or the two differ in dimension, dtype or device.
    """
    return _in_one_space(_measure(source, "source"), _measure(target, "target"))


def as_point_measures(source: MeasureLike, target: MeasureLike) -> tuple[Measure, Measure]:
    """Convert both arguments of a loss between point sets to measures of points in the same space.

    As :func:`as_measures`, but a mesh becomes the barycentres of its faces, weighted by area, and a contour the
    midpoints of its edges, weighted by length. These are the positions of its varifold.

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
    """A description of what is accepted, and of how to convert ``value``."""
    accepted = "a measure, a Mesh, a Contour, or an (n, d) array or tensor of floating-point numbers is needed"
    foreign = _FOREIGN.get(type(value).__module__.split(".")[0])
    if foreign:
        return f"{accepted}: convert it by {foreign}"
    if isinstance(value, list | tuple):
        return f"{accepted}: convert points by torch.tensor(...), or vertices and faces by Mesh(vertices, faces)"
    return f"{accepted}: points go into numpy.asarray(..., dtype=float), a triangle mesh into Mesh(vertices, faces)"
