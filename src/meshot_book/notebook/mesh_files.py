"""Small files of meshes for chapters: rounded positions, shared faces, and one number per vertex if there is one."""

import gzip
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import safetensors.torch
import torch

from meshot import Mesh
from meshot.files import whole_file
from meshot.types import Array

_LARGEST = 2**15  # indices and steps have 16 bits


def write_meshes(
    path: Path, meshes: Mapping[str, Mesh], step: float, values: Mapping[str, Array] | None = None
) -> None:
    """Write meshes and values. Each mesh is stored as its difference from the most similar one before on its faces.

    Parameters
    ----------
    path : path
        The name ends in ``.safetensors.gz``.
    meshes : mapping
        By name.
    step : float
        Positions are rounded to its multiples.
    values : mapping, optional
        One number per vertex, by the names of meshes. They are rounded to half precision.

    Raises
    ------
    ValueError
        If a mesh has more than 32 768 vertices, or reaches farther than 32 767 steps from the origin.
    """
    faces: list[torch.Tensor] = []
    tensors, places, entries = {}, {}, {}
    for name, mesh in meshes.items():
        known = [k for k, other in enumerate(faces) if torch.equal(other, mesh.faces)]
        entry = {"faces": known[0] if known else len(faces), "like": None}
        faces += [] if known else [mesh.faces]
        whole = (mesh.vertices.detach().double() / step).round().to(torch.int32).T
        if len(mesh.vertices) > _LARGEST or int(whole.abs().max()) >= _LARGEST:
            raise ValueError(
                f"{name} has {len(mesh.vertices)} vertices up to {float(mesh.vertices.abs().max()):.4g} from the "
                f"origin; at most {_LARGEST} vertices within {_LARGEST - 1} steps of {step} are stored: simplify it, "
                "or take longer steps"
            )
        similar = [other for other, its in entries.items() if its["faces"] == entry["faces"]]
        if similar:
            entry["like"] = min(similar, key=lambda other: float((whole - places[other]).abs().double().mean()))
        places[name], entries[name] = whole, entry
        tensors[name] = (whole - places.get(entry["like"], 0)).to(torch.int16).contiguous()
    tensors |= {f"faces/{k}": other.T.to(torch.int16).contiguous() for k, other in enumerate(faces)}
    tensors |= {f"values/{name}": torch.as_tensor(each).to(torch.float16) for name, each in (values or {}).items()}
    header = {"meshes": json.dumps({"step": step, "entries": entries})}
    with whole_file(path) as temporary:
        temporary.write_bytes(gzip.compress(safetensors.torch.save(tensors, header), compresslevel=9, mtime=0))


def read_meshes(path: Path) -> dict[str, Mesh]:
    """Read the meshes of a file of :func:`write_meshes`, in double precision."""
    content, header = _read(path)
    places: dict[str | None, torch.Tensor | int] = {None: 0}
    meshes = {}
    for name, entry in header["entries"].items():
        places[name] = content[name].to(torch.int32) + places[entry["like"]]
        faces = content[f"faces/{entry['faces']}"].T.to(torch.int64).contiguous()
        meshes[name] = Mesh((places[name].T.double() * header["step"]).contiguous(), faces)
    return meshes


def read_vertex_values(path: Path) -> dict[str, Array]:
    """Read the values of a file of :func:`write_meshes`, by the names of the meshes that have some."""
    content, _ = _read(path)
    return {
        name.removeprefix("values/"): each.numpy().astype(np.float64)
        for name, each in content.items()
        if name.startswith("values/")
    }


def _read(path: Path) -> tuple[dict[str, torch.Tensor], dict]:
    content = gzip.decompress(path.read_bytes())
    length = int.from_bytes(content[:8], "little")
    header = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["meshes"])
    return safetensors.torch.load(content), header
