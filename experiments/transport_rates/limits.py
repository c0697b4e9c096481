"""The limit of the sampled Chamfer distance: the Chamfer distance between the surfaces (or solids) themselves."""

import itertools

import numpy as np
from pairs import MESHES, translation

from meshot.mesh import Mesh, cube, face_areas, face_barycentres, split_in_four
from meshot.metrics import Surface, SurfaceSample


def chamfer_limit(pair: dict, config: dict) -> dict:
    """The pair with its limit, the method by which it is known, and for quadrature an estimate of its error.

    The limit is the mean squared distance from one support to the other, summed over both directions. It is zero if the
    supports are equal, for any masses on them.
    """
    relation = pair["relation"]
    if relation in ("equal", "other_density"):
        return pair | {"limit": 0.0, "known_by": "equal supports", "uncertainty": 0.0}
    if relation == "concentric":
        limit = 2 * (1 - config["inner_radius"]) ** 2
        return pair | {"limit": limit, "known_by": "closed form", "uncertainty": 0.0}
    if relation == "translated":
        return pair | {"limit": shifted_cubes(pair, config), "known_by": "closed form", "uncertainty": 0.0}
    source = cube() if pair["shape"] == "cube_surface" else MESHES[pair["shape"]]
    values = [
        surface_chamfer(source, MESHES["sphere_mesh"], refinement) for refinement in config["limits"]["refinements"]
    ]
    # The barycentre rule has an error of c·h²: two levels give the limit, a third its accuracy.
    limits = [(4 * fine - coarse) / 3 for coarse, fine in itertools.pairwise(values)]
    return pair | {"limit": limits[-1], "known_by": "quadrature", "uncertainty": abs(limits[-1] - limits[-2])}


def shifted_cubes(pair: dict, config: dict) -> float:
    """Chamfer between a unit cube and its translate by a in every coordinate, 0 ≤ a ≤ 1: 2 · d · a³/3.

    Along each axis a point at x < a has the distance a − x from the other cube, and ∫₀ᵃ (a − x)² dx = a³/3.
    """
    return 2 * float((translation(pair, config) ** 3 / 3).sum())


def surface_chamfer(source: Mesh, target: Mesh, refinement: int) -> float:
    """Chamfer between two surfaces: squared distances to faces (libigl) at the barycentres of refined faces."""
    return one_way(source, target, refinement) + one_way(target, source, refinement)


def one_way(source: Mesh, target: Mesh, refinement: int) -> float:
    """The mean over the source's area of the squared distance to the target's faces."""
    # Coarse faces are divided first, so that both sides have the same refinement.
    vertices, faces = source.vertices, source.faces
    while len(faces) < 1000:
        vertices, faces = split_in_four(vertices, faces)
    for _ in range(refinement - 2):
        vertices, faces = split_in_four(vertices, faces)
    fine = Mesh(vertices, faces)
    areas, places = face_areas(fine).numpy(), face_barycentres(fine).numpy()
    offsets = Surface(target).offsets(SurfaceSample(places, np.zeros_like(places)))
    return float((areas * offsets.distances**2).sum() / areas.sum())
