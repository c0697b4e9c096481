"""Triangulation of faces with more than three corners."""

import itertools
from collections.abc import Iterable

import numpy as np
import torch

from meshot.errors import as_floating, require_shape
from meshot.mesh.mesh import Mesh
from meshot.types import Array, Float, Int, Tensor


def triangulate(vertices: Float[Tensor, "V 3"], polygons: Iterable[Iterable[int] | Int[Tensor, " c"]]) -> Mesh:
    """The mesh of polygonal faces, each divided into triangles. Area and measure stay the same.

    A polygon with n corners is divided into n − 2 triangles of the same orientation: a fan around its first corner if
    all triangles of the fan have the same orientation (always if the polygon is convex), otherwise by ear clipping. The
    corners should lie in one plane. For other polygons the surface is not unique, and this is one choice.

    Parameters
    ----------
    vertices : tensor or array
        Floating point, one row per vertex. The mesh is differentiable with respect to them.
    polygons : sequence of sequences of int, or array
        The vertex indices of every face, in order, at least three.

    Raises
    ------
    ValueError
        If a polygon has fewer than three corners, a repeated vertex, or intersects itself; otherwise as :class:`Mesh`.

    References
    ----------
    Meisters, *Polygons have ears*, 1975.

    Examples
    --------
    >>> import torch, meshot
    >>> square = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    >>> meshot.triangulate(square, [[0, 1, 2, 3]])
    Mesh(4 vertices, 2 faces, torch.float32)
    """
    vertices = as_floating(vertices, "vertices")
    require_shape(vertices, "vertices", 3)
    places = vertices.detach().cpu().numpy().astype(np.float64)
    pieces = [_triangles(places, [int(corner) for corner in polygon], k) for k, polygon in enumerate(polygons)]
    faces = np.concatenate([np.empty((0, 3), np.int64), *pieces])
    return Mesh(vertices, torch.from_numpy(faces).to(vertices.device))


def _triangles(places: Float[Array, "V 3"], corners: list[int], k: int) -> Array:
    """The triangles of the ``k``-th polygon."""
    if len(corners) < 3 or len(set(corners)) < len(corners):
        raise ValueError(f"polygon {k} is {corners}; at least three corners are needed, each a vertex of its own")
    if min(corners) < 0 or max(corners) >= len(places):
        raise ValueError(f"polygon {k} is {corners}, but there are {len(places)} vertices: indices start at 0")
    fan = np.array([[corners[0], b, c] for b, c in itertools.pairwise(corners[1:])])
    if len(fan) == 1:
        return fan
    flat = _in_plane(places[corners])
    if (_turns(flat[[0]], flat[1:-1], flat[2:]) >= 0).all():
        return fan
    return np.array(corners)[_cut_ears(flat, k)]


def _in_plane(corners: Float[Array, "c 3"]) -> Float[Array, "c 2"]:
    """Coordinates in the plane normal to the polygon's area vector, in which the polygon runs counter-clockwise."""
    centred = corners - corners.mean(axis=0)
    area = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    _, _, axes = np.linalg.svd(area[None])
    first, second = axes[1], axes[2]
    return centred @ np.stack([first, second * np.sign(np.cross(first, second) @ area)], axis=1)


def _turns(a: Float[Array, "n 2"], b: Float[Array, "m 2"], c: Float[Array, "m 2"]) -> Float[Array, " m"]:
    """Twice the signed area of triangles: positive if a → b → c turns left."""
    ab, ac = b - a, c - a
    return ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]


def _cut_ears(flat: Float[Array, "c 2"], k: int) -> Array:
    """Triangulation by ear clipping: an ear is a left turn whose triangle contains no other corner."""
    rest, triangles = list(range(len(flat))), []
    while len(rest) > 3:
        ear = next((i for i in range(len(rest)) if _is_ear(flat, rest, i)), None)
        if ear is None:
            raise ValueError(f"polygon {k} crosses itself, so that it bounds no surface: split it where it crosses")
        triangles.append([rest[ear - 1], rest[ear], rest[(ear + 1) % len(rest)]])
        del rest[ear]
    if _turns(flat[rest[:1]], flat[rest[1:2]], flat[rest[2:]])[0] < 0:
        raise ValueError(f"polygon {k} crosses itself, so that it bounds no surface: split it where it crosses")
    return np.array([*triangles, rest])


def _is_ear(flat: Float[Array, "c 2"], rest: list[int], i: int) -> bool:
    before, at, after = rest[i - 1], rest[i], rest[(i + 1) % len(rest)]
    a, b, c = flat[[before]], flat[[at]], flat[[after]]
    if _turns(a, b, c)[0] <= 0:
        return False
    others = flat[[r for r in rest if r not in (before, at, after)]]
    sides = [
        _turns(start, np.broadcast_to(stop, others.shape), others) >= 0 for start, stop in ((a, b), (b, c), (c, a))
    ]
    return not np.logical_and.reduce(sides).any()
