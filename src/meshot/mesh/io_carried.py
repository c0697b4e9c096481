"""Files whose vertices are moved and whose other contents stay: colours, texture coordinates, materials."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import trimesh

from meshot.mesh.mesh import Mesh
from meshot.types import Float, Tensor

#: Formats that hold more than positions and faces, and that are read and written without a change of the order.
DECORATED = (".ply", ".obj", ".glb")


def write_carried(
    path: str | os.PathLike,
    source: str | os.PathLike,
    mesh: Mesh,
    carry: Callable[[Float[Tensor, "n 3"]], Float[Tensor, "n 3"]],
) -> bool:
    """Write a mesh file with the contents of another and moved vertices.

    ``mesh`` is what was read from the source. Nothing is written, and False is returned, if one of the formats holds
    no more than positions and faces, if the source has no more, or if its coordinates were changed when it was read.

    Vertices that a file repeats along a seam of its texture move together, since the motion depends on the position
    alone. The parts of a scene stay parts.
    """
    path, source = Path(path), Path(source)
    if not {path.suffix.lower(), source.suffix.lower()} <= set(DECORATED):
        return False
    loaded = trimesh.load_scene(source, process=False, maintain_order=True)
    parts = loaded.dump(concatenate=False)  # with the transforms of the scene applied
    if all(_is_plain(part) for part in parts):
        return False
    # trimesh knows nothing of SPACE=LPS, and its reader of OBJ is wrong in places.
    ours = mesh.vertices[mesh.faces.unique()].numpy()
    theirs = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts])
    ours, theirs = (np.unique(points + 0.0, axis=0) for points in (ours, theirs))
    if ours.shape != theirs.shape or not np.allclose(ours, theirs):
        return False
    for part in parts:
        part.vertices = carry(torch.from_numpy(part.vertices.copy())).detach().numpy()
    result = parts[0] if len(parts) == 1 and path.suffix.lower() != ".glb" else trimesh.Scene(parts)
    result.export(path)
    return True


def _is_plain(part: trimesh.Trimesh) -> bool:
    """Whether a part has positions and faces only."""
    texture = getattr(part.visual, "uv", None) is not None
    return not (texture or part.visual.defined or part.vertex_attributes or part.face_attributes)
