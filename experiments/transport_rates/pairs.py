"""Pairs of measures with known distance, and functions to sample from them."""

import math

import numpy as np

from meshot.mesh import Mesh, folded_sphere, icosphere, sample_points

ELLIPSOID = np.array([1.0, 0.7, 0.5])


def draw_pair(pair: dict, n_points: int, config: dict, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Independent samples of both measures of a pair, of the same size."""
    shape, d, relation = pair["shape"], pair["d"], pair["relation"]
    first = draw(shape, d, n_points, config, generator)
    if relation == "concentric":
        return first, draw(shape, d, n_points, config, generator, radius=config["inner_radius"])
    if relation == "other_density":
        return _tilted(n_points, 0.9, generator), _tilted(n_points, -0.9, generator)
    if relation == "other_surface":
        return first, draw("sphere_mesh", d, n_points, config, generator)
    second = draw(shape, d, n_points, config, generator)
    return first, second + (translation(pair, config) if relation == "translated" else 0)


def translation(pair: dict, config: dict) -> np.ndarray:
    """The vector of a translation along the diagonal of the positions. Normals do not change."""
    n_positions = pair["d"] if pair["shape"] == "cube" else 3
    along = np.zeros(pair["d"])
    along[:n_positions] = config["shift"] / math.sqrt(n_positions)
    return along


def draw(
    shape: str, d: int, n_points: int, config: dict, generator: np.random.Generator, radius: float = 1.0
) -> np.ndarray:
    """Points of one shape, uniform by area or volume. In R^6 a surface has its scaled unit normals."""
    if shape == "cube":
        return generator.random((n_points, d))
    if shape == "two_cubes":
        points = generator.random((n_points, d))
        points[:, 0] += config["gap"] * generator.integers(2, size=n_points)
        return points
    if shape in MESHES:
        return sample_points(MESHES[shape], n_points, generator).numpy()
    points, normals = {"sphere": _sphere, "ellipsoid": _ellipsoid, "cube_surface": _cube_surface}[shape](
        n_points, generator
    )
    points = radius * points
    return np.hstack([points, config["normal_scale"] * normals]) if d == 6 else points


# The two meshes are fixed polyhedra: their Chamfer distance is that of their faces, not of a smooth limit.
MESHES: dict[str, Mesh] = {"folded_mesh": folded_sphere(3, 1.0, 0.15, 5), "sphere_mesh": icosphere(3, 1.1)}


def _sphere(n_points: int, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    points = generator.standard_normal((n_points, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, points


def _ellipsoid(n_points: int, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    # The linear map stretches the area of the sphere in proportion to |A⁻¹ u|: rejection sampling.
    kept: list[np.ndarray] = []
    while sum(map(len, kept)) < n_points:
        points, _ = _sphere(2 * n_points, generator)
        stretch = np.linalg.norm(points / ELLIPSOID, axis=1) * ELLIPSOID.min()
        kept.append(points[generator.random(len(points)) < stretch])
    points = np.concatenate(kept)[:n_points]
    normals = points / ELLIPSOID
    return points * ELLIPSOID, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _cube_surface(n_points: int, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    points, normals = generator.random((n_points, 3)) - 0.5, np.zeros((n_points, 3))
    rows, axes = np.arange(n_points), generator.integers(3, size=n_points)
    normals[rows, axes] = generator.choice([-1.0, 1.0], n_points)
    points[rows, axes] = 0.5 * normals[rows, axes]
    return points, normals


def _tilted(n_points: int, slope: float, generator: np.random.Generator) -> np.ndarray:
    """Points of the unit sphere with density proportional to 1 + slope · z."""
    points, _ = _sphere(4 * n_points, generator)
    keep = generator.random(len(points)) * (1 + abs(slope)) < 1 + slope * points[:, 2]
    if keep.sum() < n_points:
        return np.concatenate([points[keep], _tilted(n_points - keep.sum(), slope, generator)])
    return points[keep][:n_points]


def known_distance(pair: dict, config: dict) -> float:
    """W_p between the two measures, for every p >= 1: zero, the translation, or the difference of the radii.

    Radial transport between concentric spheres keeps normals. It is optimal, since the distance of every point of one
    sphere from the other is at least the difference of the radii.
    """
    return {"equal": 0.0, "translated": config["shift"], "concentric": 1 - config["inner_radius"]}[pair["relation"]]


def known_slices(pair: dict, config: dict, directions: np.ndarray, p: int) -> np.ndarray:
    """W_p^p between the projections on every direction, in closed form."""
    if pair["relation"] == "equal":
        return np.zeros(len(directions))
    if pair["relation"] == "translated":
        return np.abs(directions @ translation(pair, config)) ** p
    # The projection of a sphere is uniform on an interval; normals are multiples of the positions.
    normals = config["normal_scale"] * directions[:, 3:] if pair["d"] == 6 else 0.0
    halves = [np.linalg.norm(r * directions[:, :3] + normals, axis=1) for r in (1.0, config["inner_radius"])]
    return np.abs(halves[0] - halves[1]) ** p / (p + 1)
