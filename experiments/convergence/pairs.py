"""The compared pairs of measures: sampling, and exact costs along every direction."""

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np
import torch

from meshot import Contour, Mesh, SurfaceMeasure, quasi_directions, slice_costs, surface
from meshot.mesh import circle, ellipsoid, folded_sphere, icosphere, sample_locations, star
from meshot.types import Array, Float, Tensor

#: Length of a scaled unit normal in mm. Colours and features have the same range.
SCALE_MM = 32.0
Draw = Callable[[int, np.random.Generator], Array]


@dataclasses.dataclass(frozen=True, eq=False)
class Pair:
    """Two measures, given by sampling functions and by the true cost along directions."""

    draw_source: Draw
    draw_target: Draw
    true_costs: Callable[[Float[Tensor, "L d"], float], Array]
    source: SurfaceMeasure | None = None
    target: SurfaceMeasure | None = None


@functools.cache
def make_pair(name: str, d: int, subdivisions: int = 3) -> Pair:
    """A pair by its name, lifted to R^d by features, with 1280 faces for three subdivisions."""
    if name == "contours":
        return _of_shapes(star(5, 60.0, 25.0), _moved(circle(), 40.0, (15.0, -10.0)), d)
    folded = folded_sphere(subdivisions, 40.0, 6.0)
    if name == "generic":
        return _of_shapes(folded, _moved(ellipsoid(subdivisions, (58.0, 40.0, 30.0)), 1.0, (15.0, -10.0, 8.0)), d)
    if name == "near":
        return _of_shapes(folded, ellipsoid(subdivisions, (43.0, 40.0, 37.0)), d)
    if name == "equal":
        return _of_shapes(folded, folded, d)
    if name == "disconnected":
        return _of_shapes(two_spheres(), two_spheres(), d)
    if name == "concentric":
        return spheres(40.0, 30.0, 0.0)
    raise ValueError(f"name is {name!r}; contours, generic, near, equal, disconnected or concentric is needed")


def two_spheres(radius: float = 20.0, apart: float = 100.0) -> Mesh:
    """One surface with two components, whose centres are ``apart`` mm apart."""
    left, right = (icosphere(3, radius, (0.0, 0.0, sign * apart / 2)) for sign in (-1, 1))
    faces = torch.cat([left.faces, right.faces + len(left.vertices)])
    return Mesh(torch.cat([left.vertices, right.vertices]), faces)


def _moved(shape: Mesh | Contour, factor: float, shift: tuple) -> Mesh | Contour:
    vertices = factor * shape.vertices + shape.vertices.new_tensor(shift)
    return Contour(vertices, shape.edges) if isinstance(shape, Contour) else shape.with_vertices(vertices)


def lifted(shape: Mesh | Contour, d: int) -> SurfaceMeasure:
    """A shape in R^d: positions; from d = 6 on unit normals, then smooth features at vertices (three of them colours).

    The spread of every coordinate is similar to that of the positions, so that only the dimension changes.
    """
    flat = shape.vertices.shape[1]
    n_features = d - 2 * flat
    if d == flat:
        return surface(shape)
    if n_features < 0:
        raise ValueError(f"d is {d}; {flat} (positions), {2 * flat} (and normals) or more is needed")
    if n_features == 0:
        return surface(shape, normal_scale=SCALE_MM)
    generator = np.random.default_rng([7, 0])
    waves = torch.from_numpy(generator.normal(size=(24, flat)) * 0.06)[:n_features]  # per mm
    phases = torch.from_numpy(generator.uniform(0, 2 * math.pi, 24))[:n_features]
    features = SCALE_MM * torch.sin(shape.vertices @ waves.T + phases)
    return surface(shape, normal_scale=SCALE_MM, features=features)


def _of_shapes(source: Mesh | Contour, target: Mesh | Contour, d: int) -> Pair:
    measures = lifted(source, d), lifted(target, d)
    draws = [functools.partial(_drawn, shape, measure) for shape, measure in zip((source, target), measures)]
    return Pair(*draws, lambda directions, p: slice_costs(*measures, directions, p).numpy(), *measures)


def _drawn(shape: Mesh | Contour, measure: SurfaceMeasure, n_points: int, generator: np.random.Generator) -> Array:
    """Independent points of the continuous measure, from faces and barycentric coordinates of the shape."""
    cells, barycentric = sample_locations(shape, n_points, generator)
    corners = measure.cells[cells].numpy()
    vertices, shares = measure.vertices.numpy(), barycentric.numpy()
    return sum(shares[:, [k]] * vertices[corners[:, k]] for k in range(corners.shape[1]))


def spheres(radius: float, other: float, apart: float) -> Pair:
    """Two round spheres, without meshes: the projection of a uniform sphere is uniform on an interval."""

    def draw(n_points: int, generator: np.random.Generator, size: float, shift: float) -> Array:
        points = generator.normal(size=(n_points, 3))
        points *= size / np.linalg.norm(points, axis=1, keepdims=True)
        points[:, 2] += shift
        return points

    def true_costs(directions: Float[Tensor, "L 3"], p: float) -> Array:
        return interval_costs(directions[:, 2].numpy() * apart, radius - other, p)

    source = functools.partial(draw, size=radius, shift=0.0)
    return Pair(source, functools.partial(draw, size=other, shift=apart), true_costs)


def interval_costs(shift: Array, excess: float, p: float) -> Array:
    """W_p^p between uniform distributions on two intervals.

    Their half-lengths differ by ``excess``, and their centres by ``shift``. It is the mean of |shift + excess·u|^p over
    u uniform on [−1, 1].
    """
    above, below = shift + excess, shift - excess
    return (np.sign(above) * np.abs(above) ** (p + 1) - np.sign(below) * np.abs(below) ** (p + 1)) / (
        2 * excess * (p + 1)
    )


def frames(n: int, d: int, seed: int) -> Float[Tensor, "n d"]:
    """Fixed directions in whole orthonormal frames, for which the mean of θθᵀ is exactly I/d; one is a random draw."""
    if d == 2:
        return quasi_directions(n, d, seed)
    return quasi_directions(n, d, seed, method="sobol frames")


def sampled_costs(points: Array, others: Array, directions: Array, exponents: list) -> Array:
    """W_p^p between equally many points along every direction, from sorted pairs; one row per exponent."""
    costs = np.empty((len(exponents), len(directions)))
    columns, other_columns = np.ascontiguousarray(points.T), np.ascontiguousarray(others.T)
    for index, direction in enumerate(directions):
        gap = np.sort(direction @ columns)
        gap -= np.sort(direction @ other_columns)
        np.abs(gap, out=gap)
        for row, p in enumerate(exponents):
            costs[row, index] = gap.mean() if p == 1 else gap @ gap / len(gap) if p == 2 else np.mean(gap**p)
    return costs
