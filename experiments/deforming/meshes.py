"""Targets and initial meshes, and the file of meshes for the chapter."""

import gzip
import json
import math
from pathlib import Path

import numpy as np
import safetensors.torch
import torch

from meshot import Mesh
from meshot.anatomy import fsaverage5_surface
from meshot.files import whole_file
from meshot.mesh.editing import laplacian_smoothing, smooth_crossings
from meshot.mesh.geometry import signed_volume
from meshot.mesh.shapes import folded_sphere, icosphere


def target_mesh(target: str, seed: int, config: dict) -> Mesh:
    """A member of the analytic family (stretched and rotated by the seed), or fsaverage5's white surface, repaired."""
    if target != "folded":
        return smooth_crossings(fsaverage5_surface("white", target.removeprefix("fsaverage5_")))
    shape = config["folded"]
    generator = np.random.default_rng([seed, 0])
    stretch = 1 + shape["stretch"] * generator.uniform(-1, 1, 3)
    turn = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    folded = folded_sphere(shape["subdivisions"], shape["radius"], shape["depth"], shape["n_folds"])
    return folded.with_vertices(folded.vertices @ torch.from_numpy(np.diag(stretch) @ turn.T))


def start_mesh(start: str, target: str, goal: Mesh, config: dict) -> Mesh:
    """A sphere of the target's volume around the mean of its vertices, or the smoothed target, with as many faces."""
    if start == "smoothed":
        return laplacian_smoothing(goal, config["targets"][target]["smoothing"])
    radius = (3 * float(signed_volume(goal)) / (4 * math.pi)) ** (1 / 3)
    subdivisions = round(math.log(len(goal.faces) / 20, 4))
    return icosphere(subdivisions, radius, tuple(goal.vertices.mean(dim=0).tolist()))


def write_meshes(path: Path, meshes: dict[str, Mesh], step: float) -> None:
    """Write vertices as 16-bit multiples of ``step``, each mesh as its difference from the most similar one before."""
    faces: list[torch.Tensor] = []
    tensors, places, entries = {}, {}, {}
    for name, mesh in meshes.items():
        known = [k for k, other in enumerate(faces) if torch.equal(other, mesh.faces)]
        entry = {"faces": known[0] if known else len(faces), "like": None}
        faces += [] if known else [mesh.faces]
        whole = (mesh.vertices.detach().double() / step).round().to(torch.int32).T
        similar = [other for other, its in entries.items() if its["faces"] == entry["faces"]]
        if similar:
            entry["like"] = min(similar, key=lambda other: float((whole - places[other]).abs().double().mean()))
        places[name], entries[name] = whole, entry
        tensors[name] = (whole - places.get(entry["like"], 0)).to(torch.int16).contiguous()
    tensors |= {f"faces/{k}": other.T.to(torch.int16).contiguous() for k, other in enumerate(faces)}
    header = {"meshes": json.dumps({"step": step, "entries": entries})}
    with whole_file(path) as temporary:
        temporary.write_bytes(gzip.compress(safetensors.torch.save(tensors, header), compresslevel=9, mtime=0))


def read_meshes(path: Path) -> dict[str, Mesh]:
    """Read a file of :func:`write_meshes`, in double precision."""
    content = gzip.decompress(path.read_bytes())
    length = int.from_bytes(content[:8], "little")
    header = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["meshes"])
    tensors = safetensors.torch.load(content)
    places: dict[str | None, torch.Tensor | int] = {None: 0}
    meshes = {}
    for name, entry in header["entries"].items():
        places[name] = tensors[name].to(torch.int32) + places[entry["like"]]
        faces = tensors[f"faces/{entry['faces']}"].T.to(torch.int64).contiguous()
        meshes[name] = Mesh((places[name].T.double() * header["step"]).contiguous(), faces)
    return meshes
