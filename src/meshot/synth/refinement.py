"""More triangles for a surface that few triangles only hint at."""

import torch

from meshot.mesh import Mesh
from meshot.mesh.editing import neighbour_means
from meshot.mesh.shapes import split_in_four

WARREN = 3 / 8  # how far an old vertex goes towards the mean of its neighbours, if it has more than three


def loop_subdivided(mesh: Mesh) -> Mesh:
    """A closed mesh with every triangle cut into four and all vertices smoothed by Loop's rule (Warren's weights).

    Repeated, it tends to a surface with continuous normals, and curvature almost everywhere, where cutting at the
    midpoints would leave flat facets. It shrinks a little. Old vertices keep their indices; new ones follow.

    References
    ----------
    Loop, *Smooth subdivision surfaces based on triangles*, 1987; Warren, *Subdivision methods for geometric design*,
    1995.
    """
    n_vertices, n_faces = len(mesh.vertices), len(mesh.faces)
    points, faces = split_in_four(mesh.vertices, mesh.faces)
    # The four parts of a triangle name the midpoints of its sides; the corner across from each side counts 1/8.
    midpoints = torch.cat([faces[:n_faces, 1], faces[n_faces : 2 * n_faces, 2], faces[:n_faces, 2]])
    across = mesh.vertices[mesh.faces.roll(-2, dims=1).T.flatten()]
    smoothed = torch.cat([_smoothed(mesh), 3 / 4 * points[n_vertices:]])
    return Mesh(smoothed.index_add(0, midpoints, across / 8), faces)


def smoothly_refined(mesh: Mesh, n_rounds: int = 1, n_corrections: int = 3) -> Mesh:
    """Loop subdivision of a closed mesh whose vertices are moved outwards first, so that it hardly shrinks.

    Parameters
    ----------
    mesh : Mesh
    n_rounds : int
        Each makes four faces of one.
    n_corrections : int
        Before each round the vertices are moved by what the round would take from them, so many times over: old
        vertices then come to lie nearly where they were (.007 mm away on average on fsaverage5).
    """
    for _ in range(n_rounds):
        sharpened = mesh
        for _ in range(n_corrections):
            missing = mesh.vertices - _smoothed(sharpened)
            sharpened = sharpened.with_vertices(sharpened.vertices + missing)
        mesh = loop_subdivided(sharpened)
    return mesh


def _smoothed(mesh: Mesh) -> torch.Tensor:
    return torch.lerp(mesh.vertices, neighbour_means(mesh), WARREN)
