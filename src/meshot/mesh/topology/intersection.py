"""Detection of self-intersections of a mesh."""

import igl.predicates
import numpy as np
import torch

from meshot.mesh.mesh import Mesh
from meshot.types import Int64, Tensor


def self_intersecting_faces(mesh: Mesh) -> Int64[Tensor, " n"]:
    """The faces that intersect, touch or overlap another face outside the edge or corner that they share.

    Each face is listed once. Vertices at the same position are merged first, so that adjacent faces of a triangle soup
    do not count as touching.

    Parameters
    ----------
    mesh : Mesh
        Tested in double precision with exact predicates.

    Returns
    -------
    tensor
        Indices into ``mesh.faces``, ascending.

    Notes
    -----
    Computed by libigl's ``find_self_intersections``, in about 1 s for 330 000 faces.
    """
    vertices = mesh.vertices.detach().double().cpu().numpy()
    merged, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces.cpu().numpy()]
    # A face with coincident corners has no interior that could intersect another face.
    kept = np.flatnonzero((faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0]))
    if not len(kept):
        return torch.zeros(0, dtype=torch.int64, device=mesh.faces.device)
    pairs = igl.predicates.find_self_intersections(merged, np.ascontiguousarray(faces[kept]))[1]
    found = kept[np.unique(np.asarray(pairs, dtype=np.int64))]
    return torch.from_numpy(found.astype(np.int64)).to(mesh.faces.device)
