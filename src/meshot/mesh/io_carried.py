"""Files whose vertices are moved and whose other contents stay: colours, texture coordinates, materials."""

import os
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import trimesh

from meshot.mesh.io import read_mesh
from meshot.types import Float, Tensor

#: Formats that hold more than positions and faces, and that are read and written without a change of the order.
DECORATED = (".ply", ".obj", ".glb")


def write_carried(
    path: str | os.PathLike, source: str | os.PathLike, carry: Callable[[Float[Tensor, "n 3"]], Float[Tensor, "n 3"]]
) -> bool:
    """Write a mesh file with the contents of another and moved vertices; False if the formats hold nothing more.

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
    mesh = read_mesh(source)
    ours = mesh.vertices[mesh.faces.unique()].numpy()
    theirs = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts])
    ours, theirs = (np.unique(points + 0.0, axis=0) for points in (ours, theirs))
    if ours.shape != theirs.shape or not np.allclose(ours, theirs):
        warnings.warn(
            f"{source}: trimesh finds other vertices in it, so that only positions and faces are kept", stacklevel=2
        )
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
