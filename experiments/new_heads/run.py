"""Measure all trained networks on new heads with measures that have no floor. ``config.yaml`` is the protocol.

Run as ``python experiments/new_heads/run.py`` when the held-out cohorts exist; some minutes for each network. What is
not trained yet is measured when the command is run again. ``rows.csv`` and ``pairs.csv`` have a row for each surface
and each pair of scans; ``judging.py`` makes the tables and verdicts in ``results.json`` from them.
"""

import dataclasses
import functools
import re
import sys
import time
from pathlib import Path

from meshot.anatomy import HEMISPHERES
from meshot.loss import orthogonal_directions, sliced_wasserstein
from meshot.measure import surface
from meshot.mesh import Mesh, self_intersecting_faces
from meshot.metrics import (
    Surface,
    average_surface_distance,
    hausdorff_distance,
    normal_agreement,
    offsets_between,
    rigidly_aligned,
)
from meshot.model import DeformationNetwork, SegmentationNetwork, network_digest, read_weights
from meshot.pipeline import RECORD, WEIGHTS, InitialSurfaces, in_scanner
from meshot.provenance import read_results, rounded
from meshot.synth import Subject, scans
from meshot.systems import SurfaceSystem, deformed
from meshot_book.measurements import digest_of

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment
from judging import judged

from trials.rows import read_rows, write_rows
from trials.scanned import INITIAL, Seen, reconstructed, seen
from trials.training import LAST, Training, finals, read_config, segmentation_network, trained_system

#: The files of a network that is kept without a folder: COHORT_SIDE_ARM_SEED.
NAME = re.compile(r"(?P<cohort>oasis_like|adni_like)_(?P<side>left|right)_(?P<arm>.+)_(?P<seed>\d+)")


@dataclasses.dataclass(frozen=True)
class Trained:
    """A trained system of one protocol: where its weights lie, and which of them."""

    protocol: str
    cohort: str
    sides: tuple[str, ...]
    arm: str
    budget: str
    seed: int
    which: str
    place: Path  # the folder of its networks; without a training, the name of the files of one flow
    training: Training | None = None

    def weights(self) -> Path:
        """The file of the weights of one flow."""
        return self.place.with_name(self.place.name + (WEIGHTS if self.which == "best" else LAST))

    def digest(self) -> str:
        """Twelve digits of the weights."""
        return digest_of([self.weights()] if self.training is None else sorted(self.place.glob(f"*{WEIGHTS}")))

    @property
    def name(self) -> str:
        """A name that no other has."""
        side = self.sides[0] if len(self.sides) == 1 else "both"
        parts = (self.protocol, self.cohort, side, self.arm, self.budget, self.seed, self.which)
        return "/".join(map(str, parts))


def has_folders(protocol: dict) -> bool:
    """Whether the trainings of a protocol are kept in folders: those with a budget are."""
    return any(group.get("budget") for group in protocol.get("groups", {}).values())


def trained(path: Path) -> list[Trained]:
    """The systems of a protocol whose weights are committed."""
    protocol, name = read_config(path), f"{path.parent.name}/{path.stem}"
    if has_folders(protocol):
        return [
            Trained(name, each.cohort, each.sides, each.arm, each.budget, each.seed, "best", each.kept(protocol), each)
            for each in finals(protocol)
            if each.is_made(protocol)
        ]
    arms, found = protocol.get("readings") or protocol["arms"], []
    for file in sorted(Path(protocol["weights"]).glob(f"*{WEIGHTS}")):
        which, ending = ("last", LAST) if file.name.endswith(LAST) else ("best", WEIGHTS)
        place = file.with_name(file.name.removesuffix(ending))
        # An initial surface from a binary mask is another start; the protocols share a folder.
        if (known := NAME.fullmatch(place.name)) and arms.get(known["arm"], {"start": ""}).get(
            "start", INITIAL
        ) == INITIAL:
            about = known["cohort"], (known["side"],), known["arm"], "own", int(known["seed"])
            found.append(Trained(name, *about, which, place))
    return found


def untrained(path: Path) -> list[str]:
    """The trainings of a protocol that have no weights yet, where it can say so."""
    protocol = read_config(path)
    return [each.name for each in finals(protocol) if not each.is_made(protocol)] if has_folders(protocol) else []


@functools.cache
def everything(config: experiment.Config) -> dict[str, Trained]:
    """All systems by name. What two protocols share is measured once, for the first."""
    found: dict[tuple, Trained] = {}
    for path in config["protocols"]:
        for each in trained(Path(path)):
            found.setdefault((each.place, each.which), each)
    return {each.name: each for each in found.values()}


@functools.cache
def heads(config: experiment.Config) -> dict[str, dict[str, Subject]]:
    """The new subjects of each cohort."""
    first, n = int(config["first_subject"].removeprefix("h")), config["n_subjects"]
    wanted = {f"sub-h{number:02}" for number in range(first, first + n)}
    found = {cohort: {s.name: s for s in scans(place, "test") if s.participant.participant_id in wanted}
             for cohort, place in config["cohorts"].items() if Path(place).is_dir()}  # fmt: skip
    for cohort, those in found.items():
        if len(those) < n:
            print(f"{cohort} has {len(those)} of {n} new subjects: meshot make-cohort --held-out 40", file=sys.stderr)
    return found


@functools.cache
def pairs(config: experiment.Config) -> dict[str, list[Subject]]:
    """Both scans of each new person."""
    place, found = config["consistency"], {}
    if Path(place["cohort"]).is_dir():
        for scan in scans(place["cohort"]):
            found.setdefault(scan.participant.participant_id, []).append(scan)
    return {name: both for name, both in list(found.items())[place["first_subject"] - 1 :] if len(both) == 2}


@functools.cache
def segmentation(config: experiment.Config) -> SegmentationNetwork:
    """The network that makes the initial surfaces."""
    return segmentation_network(config)


def tasks(config: experiment.Config) -> list[dict]:
    """Every system on every new head of its cohort, then on the pairs of scans if it has both sides of OASIS-like."""
    start, found = network_digest(segmentation(config))[:12], []
    for cohort, those in heads(config).items():
        systems = [each for each in everything(config).values() if each.cohort == cohort]
        for name, subject in those.items():
            place = {"what": "head", "cohort": cohort, "subject": name, "data": digest_of(subject.files())}
            found += [place | {"of": INITIAL, "digest": start}]
            found += [place | {"of": each.name, "digest": each.digest()} for each in systems]
    first = [e for e in everything(config).values() if (e.cohort, e.budget, e.seed) == ("oasis_like", "steps", 0)]
    for name, both in pairs(config).items():
        place = {"what": "pair", "subject": name, "data": [digest_of(scan.files()) for scan in both]}
        found += [
            place | {"of": INITIAL, "digest": start},
            *(place | {"of": e.name, "digest": e.digest()} for e in first),
        ]
    return found


@functools.lru_cache(maxsize=2)
def scanned(subject: Subject, config: experiment.Config) -> tuple[Seen, dict[str, Surface]]:
    """A scan, and its true surfaces with their search trees; the last two are kept."""
    found = seen(subject, InitialSurfaces(config["initial"], segmentation(config)))
    return found, {side: Surface(mesh) for side, mesh in found.truths.items()}


def found_by(name: str, subject: Subject, config: experiment.Config) -> dict[str, Mesh] | str:
    """The white surfaces of a system in scanner space, or why it found none."""
    scan, _ = scanned(subject, config)
    if name == INITIAL:
        return reconstructed(scan, None)[0]
    each = everything(config)[name]
    if each.training is not None:
        return reconstructed(scan, system_of(name, config))[0]
    (side,) = each.sides
    network = read_weights(each.weights(), DeformationNetwork)[0]
    training = read_results(each.place.with_name(each.place.name + RECORD))["config"]["training"]
    try:
        moved = deformed(scan.initial[side], scan.scan.volume, network, training["n_flow_steps"], training["method"])
    except ValueError as error:
        return str(error)
    return {side: in_scanner(moved, scan.scan)}


@functools.lru_cache(maxsize=4)
def system_of(name: str, config: experiment.Config) -> SurfaceSystem:
    """A trained system that is kept in a folder."""
    each = everything(config)[name]
    return trained_system(each.training, each.place)


def measures(mesh: Mesh, truth: Surface, settings: dict) -> dict[str, float]:
    """The measures of the protocol between a surface and the true one, in mm, or in percent."""
    found, seed = Surface(mesh), settings["seed"]
    there, back = offsets_between(found, truth, settings["n_points"], (seed, seed + 1))
    far = [float((each.distances > settings["beyond_mm"]).mean()) for each in (there, back)]
    directions = orthogonal_directions(settings["n_directions"], 3, seed)
    squared = sliced_wasserstein(surface(found.mesh), surface(truth.mesh), directions)
    n_crossing = len(self_intersecting_faces(mesh))
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "beyond_percent": 50 * sum(far),
        "signed_mm": float(truth.signed_distances(found.vertices).mean()),
        "normals": normal_agreement(there, back),
        "crossing_percent": 100 * n_crossing / len(mesh.faces),
        "exact_sw_mm": float(squared) ** 0.5,
    }


def work(task: dict, config: experiment.Config) -> dict:
    """A row for each side."""
    started, name, settings = time.process_time(), task["of"], config["evaluation"]
    sides = HEMISPHERES if name == INITIAL else everything(config)[name].sides
    is_head, subject = task["what"] == "head", task["subject"]
    subjects = [heads(config)[task["cohort"]][subject]] if is_head else pairs(config)[subject]
    surfaces = [found_by(name, each, config) for each in subjects]
    if failed := [each for each in surfaces if isinstance(each, str)]:
        return {"rows": [{"side": side, "failed": failed[0]} for side in sides]}
    rows = []
    for side in sides:
        if is_head:
            values = measures(surfaces[0][side], scanned(subjects[0], config)[1][side], settings)
        else:
            first, second = (each[side] for each in surfaces)
            moved = rigidly_aligned(second, first, config["consistency"]["n_points"], settings["seed"]).mesh
            values = measures(moved, Surface(first), settings)
        rows.append({"side": side} | rounded(values))
    return {"rows": rows, "seconds": time.process_time() - started}


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The tables and verdicts; the rows are written to files beside the results."""
    systems, lines = everything(config), {"head": [], "pair": []}
    for line in rows:
        task = line["task"]
        each = systems.get(task["of"])
        about = {
            "cohort": task.get("cohort", ""),
            "subject": task["subject"],
            "arm": INITIAL if each is None else each.arm,
        }
        about |= {key: "" if each is None else getattr(each, key) for key in ("protocol", "budget", "seed", "which")}
        lines[task["what"]] += [about | row for row in line["found"]["rows"]]
    for name, what in (("rows.csv", "head"), ("pairs.csv", "pair")):
        write_rows(config.output.with_name(name), lines[what])
    tables = [read_rows(config.output.with_name(name)) for name in ("rows.csv", "pairs.csv")]
    n, waiting = config["n_subjects"], [name for path in config["protocols"] for name in untrained(Path(path))]
    waiting += [cohort for cohort in config["cohorts"] if len(heads(config).get(cohort, ())) < n]
    waiting += [] if pairs(config) else [config["consistency"]["cohort"]]
    return rounded({"missing": waiting} | judged(*tables, config))


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "new held-out subjects of the synthetic cohorts",
                   depends=lambda config: config["evaluation"])  # fmt: skip
