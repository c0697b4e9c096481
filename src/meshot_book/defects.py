"""Errors of known kind and size that are added to a surface, to test metrics.

Bridges and intersections of sulcal walls are in ``meshot_book.defects``.

The functions do not modify their input. Lengths are in units of the vertices, mm for a cortex.
"""

import dataclasses

import numpy as np
import torch
from scipy.spatial import cKDTree

from meshot.errors import require_positive, require_positive_integer
from meshot.mesh import (
    Mesh,
    euler_number,
    face_barycentres,
    face_normals,
    laplacian_smoothing,
    self_intersecting_faces,
    vertex_normals,
)
from meshot.rng import Generator, numpy_generator
from meshot.types import Bool, Float, Int64, Tensor


def shifted(mesh: Mesh, shift: tuple[float, float, float]) -> Mesh:
    """The surface translated by a vector, as after an inaccurate registration."""
    # The distance to the original is known: W₂ is the length of the vector, SW₂ this length over √3 (without sampling).
    return mesh.with_vertices(mesh.vertices + mesh.vertices.new_tensor(shift))


def inflated(mesh: Mesh, distance: float) -> Mesh:
    """Every vertex moved along its normal, outwards if ``distance`` > 0, as by an inaccurate tissue threshold."""
    return mesh.with_vertices(mesh.vertices + distance * vertex_normals(mesh))


def noisy(mesh: Mesh, deviation: float, generator: Generator) -> Mesh:
    """Every vertex moved along its normal by an independent Gaussian distance."""
    require_positive(deviation, "deviation", "units of the vertices")
    amounts = deviation * numpy_generator(generator).standard_normal(len(mesh.vertices))
    return mesh.with_vertices(mesh.vertices + mesh.vertices.new_tensor(amounts)[:, None] * vertex_normals(mesh))


def with_hole(mesh: Mesh, centre: Float[Tensor, " 3"], radius: float) -> Mesh:
    """The surface without the faces whose barycentre lies in a ball. The result is open."""
    require_positive(radius, "radius", "units of the vertices")
    gone = (face_barycentres(mesh) - centre).norm(dim=1) <= radius
    if not bool(gone.any()) or bool(gone.all()):
        raise ValueError(
            f"{int(gone.sum())} of {len(gone)} faces lie within {radius:g} of the centre; some but not all are needed: "
            "change the radius, or move the centre onto the surface"
        )
    used, index = torch.unique(mesh.faces[~gone], return_inverse=True)
    return Mesh(mesh.vertices[used], index)


def with_spike(mesh: Mesh, vertex: int, height: float) -> Mesh:
    """The surface with one vertex moved outwards along its normal (inwards if ``height`` < 0)."""
    if not 0 <= vertex < len(mesh.vertices):
        raise ValueError(f"vertex is {vertex}; an index from 0 to {len(mesh.vertices) - 1} is needed")
    moved = mesh.vertices.clone()
    moved[vertex] += height * vertex_normals(mesh)[vertex]
    return mesh.with_vertices(moved)


def with_blurred_folds(mesh: Mesh, centre: Float[Tensor, " 3"], radius: float, n_steps: int) -> Mesh:
    """The surface with the folds in a ball smoothed, as if a gyrus or sulcus had been missed."""
    require_positive(radius, "radius", "units of the vertices")
    require_positive_integer(n_steps, "n_steps")
    away = (mesh.vertices - centre).norm(dim=1) / radius
    amount = (1 - away.square()).clamp(min=0).sqrt()[:, None]
    smooth = laplacian_smoothing(mesh, n_steps).vertices
    return mesh.with_vertices(mesh.vertices + amount * (smooth - mesh.vertices))


def unevenly_sampled(mesh: Mesh, inside: Bool[Tensor, " F"], n_rounds: int) -> Mesh:
    """The same surface with more triangles in one part: a change of the mesh without any error."""
    # Each chosen face is divided into three at its barycentre, ``n_rounds`` times. Neighbouring faces do not change and
    # the mesh stays closed. The set of points of the surface does not change; the triangles become less regular.
    require_positive_integer(n_rounds, "n_rounds")
    if inside.shape != mesh.faces.shape[:1]:
        raise ValueError(f"inside has shape {tuple(inside.shape)}; one truth value for each of {len(mesh.faces)} faces")
    vertices, cut, kept = mesh.vertices, mesh.faces[inside], mesh.faces[~inside]
    for _ in range(n_rounds):
        middle = torch.arange(len(vertices), len(vertices) + len(cut), device=cut.device)
        vertices = torch.cat([vertices, vertices[cut].mean(dim=1)])
        a, b, c = cut.T
        cut = torch.cat([torch.stack(part, dim=1) for part in ((a, b, middle), (b, c, middle), (c, a, middle))])
    return Mesh(vertices, torch.cat([kept, cut]))


def with_flipped_faces(mesh: Mesh, share: float, generator: Generator) -> Mesh:
    """The surface with randomly chosen faces reversed: the same positions, inconsistent orientation."""
    if not 0 < share <= 1:
        raise ValueError(f"share is {share!r}; a number in (0, 1] is needed, the part of the faces that is turned")
    n_turned = max(1, round(share * len(mesh.faces)))
    chosen = numpy_generator(generator).permutation(len(mesh.faces))[:n_turned]
    faces = mesh.faces.clone()
    faces[chosen] = faces[chosen].flip(1)
    return Mesh(mesh.vertices, faces)


# Opposite walls of a sulcus, and surfaces with a bridge between them or with one wall moved through the other.

FACING = 0.8  # smallest cosine between a normal and the direction to the other face


@dataclasses.dataclass(frozen=True, eq=False)
class SulcalWalls:
    """Pairs of faces that face each other across a gap, sorted by decreasing gap."""

    faces: Int64[Tensor, "n 2"]  # two face indices per row
    gaps: Float[Tensor, " n"]  # distance between the two barycentres


def facing_walls(mesh: Mesh, narrowest: float, widest: float) -> SulcalWalls:
    """Pairs of faces whose outward normals point at each other, at distances from ``narrowest`` to ``widest``."""
    if not 0 < narrowest < widest:
        raise ValueError(f"narrowest is {narrowest!r}, widest {widest!r}; 0 < narrowest < widest is needed")
    middles, normals = (x.detach().double().cpu().numpy() for x in (face_barycentres(mesh), face_normals(mesh)))
    pairs = cKDTree(middles).query_pairs(widest, output_type="ndarray")
    across = middles[pairs[:, 1]] - middles[pairs[:, 0]]
    gaps = np.linalg.norm(across, axis=1)
    ahead = (normals[pairs[:, 0]] * across).sum(axis=1)
    behind = -(normals[pairs[:, 1]] * across).sum(axis=1)
    kept = (gaps >= narrowest) & (np.minimum(ahead, behind) >= FACING * gaps)
    if not kept.any():
        raise ValueError(
            f"no two faces face each other from {narrowest:g} to {widest:g} apart; widen the range, or fold deeper"
        )
    order = np.lexsort((pairs[kept, 0], -gaps[kept]))
    return SulcalWalls(torch.from_numpy(pairs[kept][order].astype(np.int64)), torch.from_numpy(gaps[kept][order]))


def with_bridge(mesh: Mesh, narrowest: float = 2.0, widest: float = 8.0) -> Mesh:
    """The surface with a handle across a sulcus: two opposite faces are replaced by a tube between them."""
    # χ decreases by two. The pair with the widest gap is used whose tube does not intersect the surface.
    banks = facing_walls(mesh, narrowest, widest)
    n_crossing, wanted = len(self_intersecting_faces(mesh)), euler_number(mesh) - 2
    for one, other in banks.faces.tolist():
        bridged = _joined(mesh, one, other)
        if bridged is not None and len(self_intersecting_faces(bridged)) == n_crossing:
            assert euler_number(bridged) == wanted
            return bridged
    raise ValueError(f"each of {len(banks.gaps)} bridges would cross the surface; widen the range of gaps")


def _joined(mesh: Mesh, one: int, other: int) -> Mesh | None:
    """The mesh with two faces replaced by the six faces of the shortest tube; None if they share a corner."""
    first, second = mesh.faces[one], mesh.faces[other].flip(0)
    if bool(torch.isin(first, second).any()):
        return None
    sides = [(mesh.vertices[first] - mesh.vertices[second.roll(k)]).norm(dim=1).sum() for k in range(3)]
    second = second.roll(int(torch.stack(sides).argmin()))
    a, b, c, d = first, first.roll(-1), second.roll(-1), second
    tube = torch.cat([torch.stack([a, b, c], dim=1), torch.stack([a, c, d], dim=1)])
    kept = torch.ones(len(mesh.faces), dtype=torch.bool, device=mesh.faces.device)
    kept[[one, other]] = False
    return Mesh(mesh.vertices, torch.cat([mesh.faces[kept], tube]))


def with_crossing(mesh: Mesh, depth: float, narrowest: float = 1.0, widest: float = 6.0) -> Mesh:
    """The surface with one wall of a narrow sulcus moved through the other: same topology, self-intersections."""
    # The three corners of a face are moved across the narrowest gap and by ``depth`` beyond it.
    if not depth > 0:
        raise ValueError(f"depth is {depth!r}; a length > 0 is needed, how far beyond the other bank")
    one, other = facing_walls(mesh, narrowest, widest).faces[-1].tolist()
    middles = face_barycentres(mesh)
    across = middles[other] - middles[one]
    moved = mesh.vertices.clone()
    moved[mesh.faces[one]] += across * (1 + depth / across.norm())
    return mesh.with_vertices(moved)
