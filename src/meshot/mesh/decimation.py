"""Fewer faces for the same surface."""

import igl
import numpy as np
import torch

from meshot.errors import require_positive_integer
from meshot.mesh.mesh import Mesh


def decimated(mesh: Mesh, n_faces: int) -> Mesh:
    """The mesh after its shortest edges have been collapsed to their midpoints, until about ``n_faces`` are left.

    An edge is collapsed only where that leaves the topology as it is. Faces may come to cross: count them afterwards.

    Parameters
    ----------
    mesh : Mesh
        Closed or open, manifold; returned as it is if it has no more faces than asked for.
    n_faces : int

    Raises
    ------
    ValueError
        If ``n_faces`` < 1.
    """
    require_positive_integer(n_faces, "n_faces")
    if len(mesh.faces) <= n_faces:
        return mesh
    vertices, faces = igl.decimate(mesh.vertices.detach().double().cpu().numpy(), mesh.faces.cpu().numpy(), n_faces)[:2]
    return Mesh(
        torch.from_numpy(np.ascontiguousarray(vertices)).to(mesh.vertices),
        torch.from_numpy(np.ascontiguousarray(faces, dtype=np.int64)),
    )
