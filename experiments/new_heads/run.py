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

import igl
import numpy as np

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
from meshot.pipeline import RECORD, WEIGHTS, InitialSurfaces, in_scanner, segmentation_weights
from meshot.provenance import read_results, rounded
from meshot.synth import Subject, scans
from meshot.systems import Scan, deformed
from meshot_book.measurements import digest_of

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment
from judging import judged

from trials.rows import read_rows, write_rows
from trials.training import LAST, finals, read_config, trained_system

INITIAL = "initial"
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
    place: Path

    @property
    def name(self) -> str:
        """A name that no other has."""
        side = self.sides[0] if len(self.sides) == 1 else "both"
        parts = (self.protocol, self.cohort, side, self.arm, self.budget, self.seed, self.which)
        return "/".join(map(str, parts))


def trained(path: Path) -> list[Trained]:
    """The systems of a protocol whose weights are committed."""
    protocol, name = read_config(path), f"{path.parent.name}/{path.stem}"
    if "readings" not in protocol and any(group.get("budget") for group in protocol["groups"].values()):
        return [
            Trained(name, each.cohort, each.sides, each.arm, each.budget, each.seed, "best", each.kept(protocol))
            for each in finals(protocol)
            if each.is_made(protocol)
        ]
    arms, found = protocol.get("readings") or protocol["arms"], []
    for file in sorted(Path(protocol["weights"]).glob(f"*{WEIGHTS}")):
        which, ending = ("last", LAST) if file.name.endswith(LAST) else ("best", WEIGHTS)
        known = NAME.fullmatch(file.name.removesuffix(ending))
        # An initial surface from a binary mask is another start; the protocols share a folder.
        if known and known["arm"] in arms and arms[known["arm"]].get("start", INITIAL) == INITIAL:
            place = file.with_name(file.name.removesuffix(ending))
            found.append(
                Trained(name, known["cohort"], (known["side"],), known["arm"], "own", int(known["seed"]), which, place)
            )
    return found


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
    return read_weights(segmentation_weights(config["segmentation"]), SegmentationNetwork)[0]


def digest(each: Trained) -> str:
    """Twelve digits of the weights of a system."""
    if each.budget != "own":
        return digest_of(sorted(each.place.glob(f"*{WEIGHTS}")))
    return digest_of([each.place.with_name(each.place.name + (WEIGHTS if each.which == "best" else LAST))])


def tasks(config: experiment.Config) -> list[dict]:
    """Every system on every new head of its cohort, then on the pairs of scans if it has both sides of OASIS-like."""
    start, found = network_digest(segmentation(config))[:12], []
    for cohort, those in heads(config).items():
        systems = [each for each in everything(config).values() if each.cohort == cohort]
        for name, subject in those.items():
            place = {"what": "head", "cohort": cohort, "subject": name, "data": digest_of(subject.files())}
            found += [place | {"of": INITIAL, "digest": start}]
            found += [place | {"of": each.name, "digest": digest(each)} for each in systems]
    first = [e for e in everything(config).values() if (e.cohort, e.budget, e.seed) == ("oasis_like", "steps", 0)]
    for name, both in pairs(config).items():
        place = {"what": "pair", "subject": name, "data": [digest_of(scan.files()) for scan in both]}
        found += [
            place | {"of": INITIAL, "digest": start},
            *(place | {"of": e.name, "digest": digest(e)} for e in first),
        ]
    return found


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """A scan with its initial surfaces in standard space, and its true surfaces in scanner space."""

    scan: object
    initial: dict[str, Mesh]
    truths: dict[str, Surface]


@functools.lru_cache(maxsize=2)
def seen(subject: Subject, config: experiment.Config) -> Seen:
    """Read a scan; the last two are kept."""
    scan, surfaces = subject.standard(), InitialSurfaces(config["initial"], segmentation(config))
    initial = {side: surfaces.of(subject, side, scan) for side in HEMISPHERES}
    return Seen(scan, initial, {side: Surface(subject.surface("white", side)) for side in HEMISPHERES})


def found_by(name: str, subject: Subject, config: experiment.Config) -> dict[str, Mesh] | str:
    """The white surfaces of a system in scanner space, or why it found none."""
    there = seen(subject, config)
    if name == INITIAL:
        return {side: in_scanner(mesh, there.scan) for side, mesh in there.initial.items()}
    each = everything(config)[name]
    try:
        if each.budget == "own":
            (side,) = each.sides
            network = read_weights(
                each.place.with_name(each.place.name + (WEIGHTS if each.which == "best" else LAST)), DeformationNetwork
            )[0]
            training = read_results(each.place.with_name(each.place.name + RECORD))["config"]["training"]
            flow = training["n_flow_steps"], training["method"]
            return {side: in_scanner(deformed(there.initial[side], there.scan.volume, network, *flow), there.scan)}
        system = system_of(name, config)
        given = Scan(there.scan.volume, {key: there.initial[key[0]] for key in type(system).needs})
        made = system.reconstruct(given)
    except ValueError as error:
        return str(error)
    return {side: in_scanner(mesh, there.scan) for (side, kind), mesh in made.items() if kind == "white"}


@functools.lru_cache(maxsize=4)
def system_of(name: str, config: experiment.Config) -> object:
    """A trained system that is kept in a folder."""
    each = everything(config)[name]
    protocol = read_config(next(Path(path) for path in config["protocols"] if each.protocol.endswith(Path(path).stem)
                                and each.protocol.startswith(Path(path).parent.name)))  # fmt: skip
    training = next(t for t in finals(protocol) if t.kept(protocol) == each.place)
    return trained_system(training, each.place)


def measures(mesh: Mesh, truth: Surface, settings: dict) -> dict[str, float]:
    """The measures of the protocol between a surface and the true one, in mm, or in percent."""
    found, seed = Surface(mesh), settings["seed"]
    there, back = offsets_between(found, truth, settings["n_points"], (seed, seed + 1))
    far = [float((each.distances > settings["beyond_mm"]).mean()) for each in (there, back)]
    signs = igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    signed = igl.signed_distance(found.vertices, truth.vertices, truth.faces, sign_type=signs)[0]
    directions = orthogonal_directions(settings["n_directions"], 3, seed)
    squared = sliced_wasserstein(surface(found.mesh), surface(truth.mesh), directions)
    n_crossing = len(self_intersecting_faces(mesh))
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "beyond_percent": 50 * sum(far),
        "signed_mm": float(np.mean(signed)),
        "normals": normal_agreement(there, back),
        "crossing_percent": 100 * n_crossing / len(mesh.faces),
        "exact_sw_mm": float(squared) ** 0.5,
    }


def work(task: dict, config: experiment.Config) -> dict:
    """A row for each side."""
    started, name, settings = time.process_time(), task["of"], config["evaluation"]
    sides = HEMISPHERES if name == INITIAL else everything(config)[name].sides
    scanned = (
        [heads(config)[task["cohort"]][task["subject"]]] if task["what"] == "head" else pairs(config)[task["subject"]]
    )
    surfaces = [found_by(name, subject, config) for subject in scanned]
    if failed := [each for each in surfaces if isinstance(each, str)]:
        return {"rows": [{"side": side, "failed": failed[0]} for side in sides]}
    rows = []
    for side in sides:
        if task["what"] == "head":
            values = measures(surfaces[0][side], seen(scanned[0], config).truths[side], settings)
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
    waiting = [
        name
        for cohort in config["cohorts"]
        for name in [cohort]
        if len(heads(config).get(cohort, ())) < config["n_subjects"]
    ]
    return rounded({"missing": waiting} | judged(*tables, config))


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "new held-out subjects of the synthetic cohorts",
                   depends=lambda config: config["evaluation"])  # fmt: skip
