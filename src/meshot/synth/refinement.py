"""Smooth refinement of triangle meshes by Loop subdivision."""

import torch

from meshot.mesh import Mesh
from meshot.mesh.editing import neighbour_means
from meshot.mesh.shapes import split_in_four

WARREN = 3 / 8  # fraction of the way to the mean of the neighbours for old vertices with more than three neighbours


def loop_subdivided(mesh: Mesh) -> Mesh:
    """A closed mesh after one step of Loop subdivision (with Warren's weights): four faces for each face.

    Repeated steps converge to a surface with continuous normals, and curvature almost everywhere. Subdivision at the
    midpoints alone would keep flat faces. The mesh shrinks slightly. Old vertices keep their indices; new ones follow.

    References
    ----------
    Loop, *Smooth subdivision surfaces based on triangles*, 1987; Warren, *Subdivision methods for geometric design*,
    1995.
    """
    n_vertices, n_faces = len(mesh.vertices), len(mesh.faces)
    points, faces = split_in_four(mesh.vertices, mesh.faces)
    # The four parts of a triangle contain the midpoints of its sides; the corner opposite to a side has weight 1/8.
    midpoints = torch.cat([faces[:n_faces, 1], faces[n_faces : 2 * n_faces, 2], faces[:n_faces, 2]])
    across = mesh.vertices[mesh.faces.roll(-2, dims=1).T.flatten()]
    smoothed = torch.cat([_smoothed(mesh), 3 / 4 * points[n_vertices:]])
    return Mesh(smoothed.index_add(0, midpoints, across / 8), faces)


def smoothly_refined(mesh: Mesh, n_rounds: int = 1, n_corrections: int = 3) -> Mesh:
    """Loop subdivision of a closed mesh whose vertices are first moved outwards to compensate for the shrinkage.

    Parameters
    ----------
    mesh : Mesh
    n_rounds : int
        Number of subdivisions. Each multiplies the number of faces by four.
    n_corrections : int
        Number of times that, before each subdivision, vertices are moved by the displacement it would cause. Old
        vertices then stay nearly in place (.007 mm away on average for fsaverage5).
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
