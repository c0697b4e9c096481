"""Hashes of the content of a cohort: of the numbers in the files, independent of their compression."""

import hashlib
import importlib.metadata
import json
import os
from pathlib import Path

import numpy as np

from meshot.files import whole_file
from meshot.mesh import read_mesh
from meshot.synth.cohorts.cohort import Subject, participants, scans
from meshot.synth.cohorts.recipe import Recipe
from meshot.types import Array
from meshot.volume import read_volume

#: Numbers are rounded to multiples of 1 / these before hashing: values of voxels and vertices, and entries of affines.
VALUE_PARTS, AFFINE_PARTS = 2**16, 10**5
_MADE_BY = ("numpy", "scipy", "torch", "SimpleITK", "nilearn", "libigl")


def content_hash(path: str | os.PathLike) -> str:
    """The SHA-256 of a file's content: voxels and affine, or vertices and faces, or otherwise its bytes.

    Raises
    ------
    ValueError
        If an image or a mesh cannot be read.
    """
    path = Path(path)
    if path.name.endswith(".nii.gz"):
        volume = read_volume(path)
        parts = [_whole(volume.data, VALUE_PARTS), _whole(volume.affine, AFFINE_PARTS), np.array(volume.data.shape)]
    elif path.name.endswith(".surf.gii"):
        mesh = read_mesh(path)
        parts = [_whole(mesh.vertices.numpy(), VALUE_PARTS), mesh.faces.numpy()]
    else:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    total = hashlib.sha256()
    for part in parts:
        total.update(np.ascontiguousarray(part, dtype="<i8").tobytes())
    return total.hexdigest()


def _whole(values: Array, parts: int) -> Array:
    return np.rint(np.asarray(values, dtype=np.float64) * parts)


def digest(hashes: dict[str, str]) -> str:
    """One hash of the hashes of several files, independent of their order."""
    return hashlib.sha256("\n".join(f"{name} {hashes[name]}" for name in sorted(hashes)).encode()).hexdigest()


def write_manifest(recipe: Recipe, folder: str | os.PathLike) -> None:
    """Write ``manifest.json``: name and seed of the recipe, versions, processors, and for each scan seed and hashes."""
    folder = Path(folder)
    logs = [json.loads(path.read_text(encoding="utf-8")) for path in sorted((folder / "logs").glob("*.json"))]
    logged = {name: hashes for log in logs for name, hashes in log["hashes"].items()}
    found = {
        scan.name: {
            "split": scan.participant.split,
            "seed": scan.participant.seed,
            "digest": digest(logged[scan.name]),
            "files": logged[scan.name],
        }
        for scan in scans(folder)
    }
    content = {
        "recipe": recipe.name,
        "seed": recipe.seed,
        "versions": {name: importlib.metadata.version(name) for name in _MADE_BY},
        # The logs of older visits have no processor.
        "processors": sorted({log["processor"] for log in logs if "processor" in log}),
        "scans": found,
    }
    with whole_file(folder / "manifest.json") as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def keep_digests(path: str | os.PathLike, folder: str | os.PathLike) -> None:
    """Add seed, split and digest of every scan of a finished cohort to a JSON file of several cohorts.

    Raises
    ------
    ValueError
        If the cohort has no manifest.
    """
    path, manifest = Path(path), _manifest(Path(folder))
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    brief = [{key: entry[key] for key in ("split", "seed", "digest")} for entry in manifest["scans"].values()]
    known[manifest["recipe"]] = manifest | {"scans": dict(zip(manifest["scans"], brief, strict=True))}
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n", encoding="utf-8")


def _manifest(folder: Path) -> dict:
    participants(folder)
    path = folder / "manifest.json"
    if not path.is_file():
        raise ValueError(f"{path} does not exist: the cohort is not finished; go on with meshot make-cohort")
    return json.loads(path.read_text(encoding="utf-8"))


def changed_files(folder: str | os.PathLike) -> list[str]:
    """The files of a cohort that are missing or differ from its manifest.

    Raises
    ------
    ValueError
        If there is no cohort, or it has no manifest.
    """
    folder = Path(folder)
    kept = _manifest(folder)["scans"]
    here: dict[str, Subject] = {scan.name: scan for scan in scans(folder)}
    changed = []
    for name, entry in kept.items():
        files = {p.name: p for p in here[name].files()} if name in here else {}
        changed += [f for f, wanted in entry["files"].items() if f not in files or _hash(files[f]) != wanted]
    return changed


def _hash(path: Path) -> str:
    try:
        return content_hash(path)
    except ValueError:
        return "unreadable"
