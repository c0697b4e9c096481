"""Generation of cohorts on disk from a recipe: parallel, resumable, with a manifest."""

import concurrent.futures
import dataclasses
import functools
import hashlib
import importlib.metadata
import itertools
import json
import multiprocessing
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from meshot.errors import require_positive_integer
from meshot.files import scratch_folder, write_whole
from meshot.mesh import read_mesh
from meshot.provenance import processor
from meshot.synth import cohorts as cohort
from meshot.synth.cohorts import Participant, Subject, participants, scans
from meshot.synth.recipe import (
    People,
    Recipe,
    drawn_appearance,
    drawn_person,
    drawn_position,
    drawn_shape,
    drawn_structures,
    plan,
    read_recipe,
    recipe_text,
)
from meshot.synth.scanning import Anatomy, Position, rounded, simulated_scan, standardised, surface_facts, write_scan
from meshot.synth.subject import CorticalSurfaces, Shape, synthetic_subject
from meshot.types import PLACEMENTS, Array
from meshot.volume import read_volume
from meshot.workers import begin_worker

#: Entries of a recipe that may change without a change of the scans that exist already.
_GROWING = ("subjects", "procedural_subjects", "held_out_subjects", "days")


@dataclasses.dataclass(frozen=True)
class Visit:
    """One participant on one day. All scans of a visit are made together and appear on disk together."""

    participant: Participant
    session: str | None  # such as "01"; None if each participant is scanned only once

    @property
    def folder(self) -> Path:
        """The folder of the visit in the cohort. If it exists, the visit is complete."""
        return Path(self.participant.participant_id, *([f"ses-{self.session}"] if self.session else []))


def visits(recipe: Recipe) -> list[Visit]:
    """All visits of a recipe, in order."""
    once = recipe.days == recipe.scans_per_day == 1
    sessions = [None] if once else [f"{day + 1:02d}" for day in range(recipe.days)]
    return [Visit(participant, session) for session in sessions for participant in plan(recipe)]


def open_cohort(recipe: Recipe, folder: str | os.PathLike) -> list[Visit]:
    """Create a cohort's folder, or open an existing one, and return the visits that are missing.

    Raises
    ------
    ValueError
        If the folder contains a cohort from another recipe, or other files.
    """
    folder = Path(folder)
    kept = folder / "recipe.yaml"
    if kept.exists():
        before, now = (dataclasses.asdict(r) for r in (read_recipe(kept), recipe))
        other = [key for key in now if before[key] != now[key] and key not in _GROWING]
        if other or (before["days"] * before["scans_per_day"] == 1) != (now["days"] * now["scans_per_day"] == 1):
            raise ValueError(
                f"{folder} holds a cohort made from another recipe (different: {', '.join(other) or 'days'}); "
                "choose another folder"
            )
    elif folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty and holds no cohort; choose another folder")
    write_whole(kept, recipe_text(recipe))
    rows = ["participant_id\tsplit\tkind\tseed"]
    rows += ["\t".join(map(str, dataclasses.astuple(participant))) for participant in plan(recipe)]
    write_whole(folder / "participants.tsv", "\n".join(rows) + "\n")
    write_whole(folder / "dseg.tsv", "index\tname\n" + "".join(f"{i}\t{name}\n" for name, i in cohort.LABELS.items()))
    for place, kind in ((folder, "raw"), (folder / "derivatives" / "standard", "derivative")):
        content = {"Name": recipe.name, "BIDSVersion": "1.10.0", "DatasetType": kind}
        content["License"] = "see data_synth/README.md"
        content["GeneratedBy"] = [{"Name": "meshot", "Description": "synthetic: no person was scanned"}]
        write_whole(place / "dataset_description.json", json.dumps(content, indent=1) + "\n")
    return [visit for visit in visits(recipe) if not (folder / visit.folder).is_dir()]


def make_cohort(recipe: Recipe, folder: str | os.PathLike, jobs: int = 1) -> Iterator[str]:
    """Make the missing visits of a cohort, and yield the folder of each when it is complete on disk.

    There are ``jobs`` processes, each with one thread.

    Raises
    ------
    ValueError
        As :func:`open_cohort`, or if ``jobs`` is not a positive integer.
    """
    require_positive_integer(jobs, "jobs")
    missing, folder = open_cohort(recipe, folder), Path(folder)
    make = functools.partial(make_visit, recipe, folder)
    if jobs == 1:
        yield from map(make, missing)
    else:
        # A fork would copy locks that other threads hold; a new process does not.
        context = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(jobs, context, initializer=begin_worker) as pool:
            futures = [pool.submit(make, visit) for visit in missing]
            try:
                for future in concurrent.futures.as_completed(futures):
                    yield future.result()
            finally:
                pool.shutdown(cancel_futures=True)
    write_manifest(recipe, folder)


def make_visit(recipe: Recipe, folder: Path, visit: Visit) -> str:
    """Make all scans of one visit in a hidden folder, then move them to their final place."""
    # A visit that another run has made in the meantime stays, because both are the same.
    place = folder / visit.folder
    derived = folder / "derivatives" / "standard" / visit.folder
    with scratch_folder(folder) as made:
        started = time.process_time()
        seconds, hashes = {}, {}
        for run in range(recipe.scans_per_day):
            name = str(run + 1) if recipe.scans_per_day > 1 else None
            subject = Subject(made, visit.participant, visit.session, name)
            seconds[subject.name] = make_scan(recipe, subject, run)
            hashes[subject.name] = {p.name: content_hash(p) for p in subject.files()}
        seconds |= {"total": time.process_time() - started}
        log = {"cpu_seconds": seconds, "processor": processor(), "hashes": hashes}
        if place.is_dir():
            return str(visit.folder)
        # The derivatives first, because the folder of the scans marks a complete visit.
        for source, target in (
            (made / "derivatives" / "standard" / visit.folder, derived),
            (made / visit.folder, place),
        ):
            shutil.rmtree(target, ignore_errors=True)
            target.parent.mkdir(parents=True, exist_ok=True)
            if target == place:
                write_whole(folder / "logs" / f"{'_'.join(visit.folder.parts)}.json", json.dumps(log, indent=1) + "\n")
            os.replace(source, target)
    return str(visit.folder)


@functools.lru_cache(maxsize=1)
def _surfaces(shape: Shape, seed: int) -> CorticalSurfaces:
    """The surfaces of a subject. Cached, since the scans of one subject are made one after another."""
    return synthetic_subject(shape, seed)


def make_scan(recipe: Recipe, place: Subject, run: int = 0) -> dict[str, float]:
    """Make and write one scan with all its files. Returns the CPU seconds of each stage."""
    seed, clock = place.participant.seed, [time.process_time()]
    appearance, (shape, anatomy, position) = drawn_appearance(recipe, seed), _drawn(recipe, place.participant)
    surfaces = _surfaces(shape, seed)
    clock.append(time.process_time())
    scan_seed = [seed, 3, int(place.session or 0), run]
    scan = simulated_scan(surfaces, anatomy, appearance, position, scan_seed)
    clock.append(time.process_time())
    standard = standardised(scan, recipe.registration_mm, by_white_matter=recipe.standard == PLACEMENTS[1])
    clock.append(time.process_time())
    knobs = {"shape": shape, "appearance": appearance, "anatomy": anatomy, "position": position}
    facts = {
        "participant": dataclasses.asdict(place.participant),
        "scan_seed": scan_seed,
        # Without those that are None, so that parameters of later versions do not change the files of before.
        "knobs": {
            name: rounded({key: each for key, each in dataclasses.asdict(value).items() if each is not None})
            for name, value in knobs.items()
        },
        "head_to_scanner": rounded(scan.head_to_scanner.tolist()),
        "deformation_strength": rounded(surfaces.strength),
        "surfaces": surface_facts(scan, surfaces),
    }
    write_scan(place, scan, standard, facts)
    clock.append(time.process_time())
    return dict(zip(("geometry", "image", "registration", "writing"), (b - a for a, b in itertools.pairwise(clock))))


def _drawn(recipe: Recipe, participant: Participant) -> tuple[Shape, Anatomy, Position]:
    """Cortex, rest of the head, and position of a participant."""
    shape, position = drawn_shape(recipe, participant.kind), drawn_position(recipe)
    if recipe.people:
        return drawn_person(People.read(recipe.people), shape, position, participant.seed)
    fixed = {"head_mm": recipe.head_mm, "n_lines": recipe.n_lines, "leaf_mm": recipe.leaf_mm}
    return shape, Anatomy(**drawn_structures(recipe, participant.seed), **fixed), position


# Hashes of the content of a cohort: of the numbers in the files, independent of their compression.

#: Numbers are rounded to multiples of 1 / these before hashing: values of voxels and vertices, and entries of affines.
VALUE_PARTS, AFFINE_PARTS = 2**16, 10**5
_MADE_BY = ("numpy", "scipy", "torch", "SimpleITK", "nilearn", "libigl")


def content_hash(path: str | os.PathLike) -> str:
    """The SHA-256 of a file's content: voxels and affine, or vertices and faces, or otherwise its bytes."""
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
    write_whole(folder / "manifest.json", json.dumps(content, indent=1) + "\n")


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
    write_whole(path, json.dumps(dict(sorted(known.items())), indent=1) + "\n")


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
