"""Opposite walls of a sulcus, and surfaces with a bridge between them or with one wall moved through the other."""

import dataclasses

import numpy as np
import torch
from scipy.spatial import cKDTree

from meshot.mesh import Mesh
from meshot.mesh.geometry import face_barycentres, face_normals
from meshot.mesh.topology import euler_number, self_intersecting_faces
from meshot.types import Float, Int64, Tensor

FACING = 0.8  # smallest cosine between a normal and the direction to the other face


@dataclasses.dataclass(frozen=True, eq=False)
class SulcalWalls:
    """Pairs of faces that face each other across a gap, sorted by decreasing gap.

    Parameters
    ----------
    faces : tensor
        Two face indices per row.
    gaps : tensor
        Distance between the two barycentres.
    """

    faces: Int64[Tensor, "n 2"]
    gaps: Float[Tensor, " n"]


def facing_walls(mesh: Mesh, narrowest: float, widest: float) -> SulcalWalls:
    """Pairs of faces whose outward normals point at each other, at distances from ``narrowest`` to ``widest``.

    Raises
    ------
    ValueError
        If 0 < narrowest < widest does not hold, or there is no such pair.
    """
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
            f"no two faces look at each other from {narrowest:g} to {widest:g} apart; widen the range, or fold deeper"
        )
    order = np.lexsort((pairs[kept, 0], -gaps[kept]))
    return SulcalWalls(torch.from_numpy(pairs[kept][order].astype(np.int64)), torch.from_numpy(gaps[kept][order]))


def with_bridge(mesh: Mesh, narrowest: float = 2.0, widest: float = 8.0) -> Mesh:
    """The surface with a handle across a sulcus: two opposite faces are replaced by a tube between them.

    χ decreases by two. The pair with the widest gap is used whose tube does not intersect the surface.

    Raises
    ------
    ValueError
        As :func:`meshot.synth.defects.facing_walls`, or if every tube would intersect the surface.
    """
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
    """The surface with one wall of a narrow sulcus moved through the other: same topology, self-intersections.

    The three corners of a face are moved across the narrowest gap and by ``depth`` beyond it.

    Raises
    ------
    ValueError
        As :func:`meshot.synth.defects.facing_walls`, or if ``depth`` is not positive.
    """
    if not depth > 0:
        raise ValueError(f"depth is {depth!r}; a length > 0 is needed, how far beyond the other bank")
    one, other = facing_walls(mesh, narrowest, widest).faces[-1].tolist()
    middles = face_barycentres(mesh)
    across = middles[other] - middles[one]
    moved = mesh.vertices.clone()
    moved[mesh.faces[one]] += across * (1 + depth / across.norm())
    return mesh.with_vertices(moved)
