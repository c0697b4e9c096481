"""Measurements of the networks of a protocol: with their best and with their last weights, on subjects of all splits.

Distances are those of ``measuring.py``, in scanner space and without repair. The loss of a network is that of its last
step, between the coarse surface of the training and the true one, with directions, samples or windows of one seed.
"""

import dataclasses
import functools
import hashlib
import json
from collections.abc import Iterator

import numpy as np
from trainings import LAST, Wanted

from meshot.anatomy import Hemisphere
from meshot.mesh import Mesh
from meshot.metrics import evaluate
from meshot.model import DeformationNetwork, SegmentationNetwork, network_digest, read_weights
from meshot.pipeline import RECORD, WEIGHTS, InitialSurfaces, in_scanner
from meshot.provenance import read_results
from meshot.synth import Subject, scans
from meshot.systems import DeformationConfig, DeformationExample, deformed, hemisphere_example
from meshot.volume import StandardScan
from meshot_book.measurements import digest_of, metric_values

#: The two kinds of weights of a network, with the endings of their files.
WHICH = {"best": WEIGHTS, "last": LAST}
START = "start"


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """One hemisphere of one subject: in the standard space as in a training, and its true surface in scanner space."""

    scan: StandardScan
    example: DeformationExample
    truth: Mesh


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """What is measured: the networks by start, each with its configuration, on the subjects by split."""

    protocol: dict
    configs: dict[str, dict]
    there: dict[str, list[Wanted]]
    segmentation: SegmentationNetwork

    @functools.cached_property
    def subjects(self) -> dict[str, dict[str, Subject]]:
        """The first subjects of the training, those of validation, and the held-out ones."""
        own, settings = self.protocol["cohorts"][self.protocol["cohort"]], self.protocol["evaluation"]
        places = {"train": own, "validation": own, "test": settings["cohort"]}
        found = {split: scans(place, split) for split, place in places.items()}
        found["train"] = found["train"][: settings["n_training"]]
        return {split: {each.name: each for each in those} for split, those in found.items()}

    @functools.lru_cache(maxsize=1)  # noqa: B019 (there is one object in a run)
    def seen(self, split: str, subject: str, start: str, n_faces: int) -> Seen:
        """A hemisphere; the last one is kept, which the tasks need one after another."""
        surfaces = InitialSurfaces(self.configs[start]["initial"], self.segmentation)
        return seen(self.subjects[split][subject], self.protocol["side"], surfaces, n_faces)

    def named(self, start: str, arm: str) -> Wanted:
        """The network of an arm."""
        return next(each for each in self.there[start] if each.arm == arm)

    def deformation(self, start: str, arm: str) -> DeformationConfig:
        """All settings of an arm."""
        return self.named(start, arm).settings(self.configs[start])


def seen(subject: Subject, side: Hemisphere, surfaces: InitialSurfaces, n_faces: int) -> Seen:
    """Read one hemisphere, with a coarse initial surface of so many faces."""
    keys = [(side, "white")]
    example = hemisphere_example(surfaces.example(subject, keys, keys), side, n_faces)
    return Seen(subject.standard(), example, subject.surface("white", side))


def measured(found: Seen, mesh: Mesh, settings: dict) -> dict[str, float]:
    """The metrics of a mesh of the standard space."""
    points = settings["n_points"], settings["seed"], settings["n_emd_points"]
    return metric_values(evaluate(in_scanner(mesh, found.scan), found.truth, *points, floors=False))


def network_row(found: Seen, network: DeformationNetwork, config: DeformationConfig, settings: dict) -> dict:
    """The metrics after a flow, and the loss of the network before and after it. ``failed`` if the flow diverges."""
    flow, example = (config.training.n_flow_steps, config.training.method), found.example
    try:
        whole = deformed(example.initial, example.scan, network, *flow)
        coarse = deformed(example.coarse, example.scan, network, *flow, standard=example.initial)
    except ValueError as error:
        return {"failed": str(error)}
    losses = {"loss_before": example.coarse, "loss_after": coarse}
    return measured(found, whole, settings) | {
        name: own_loss(mesh, example.target, config, settings["seed"]) for name, mesh in losses.items()
    }


def own_loss(mesh: Mesh, target: Mesh, config: DeformationConfig, seed: int) -> float:
    """The loss of the last step of a training."""
    return float(config.loss.at(1.0)(mesh, target, np.random.default_rng(seed)))


def tasks_of(setting: Setting) -> Iterator[dict]:
    """All tasks: for every subject and start the initial surface, and both kinds of weights of every network."""
    for split, those in setting.subjects.items():
        for subject, scan in those.items():
            place = {"split": split, "subject": subject, "data": digest_of(scan.files())}
            for start, networks in setting.there.items():
                own = place | {"start": start, "digest": network_digest(setting.segmentation)[:12]}
                yield own | {"arm": START, "weights": None}
                for each in networks:
                    settings = {
                        "settings": _short(json.dumps(each.settings(setting.configs[start]).as_dict()).encode())
                    }
                    for which, ending in WHICH.items():
                        digest = digest_of([each.kept(setting.configs[start], ending)])
                        yield own | {"arm": each.arm, "weights": which, "digest": digest} | settings


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]


def row_of(task: dict, setting: Setting) -> dict:
    """The measurement of a task."""
    start, arm, settings = task["start"], task["arm"], setting.protocol["evaluation"]
    first = setting.there[start][0].arm if arm == START else arm
    config = setting.deformation(start, first)
    found = setting.seen(task["split"], task["subject"], start, config.training.n_faces)
    if arm == START:
        return measured(found, found.example.initial, settings)
    path = setting.named(start, arm).kept(setting.configs[start], WHICH[task["weights"]])
    return network_row(found, read_weights(path, DeformationNetwork)[0], config, settings)


def courses(setting: Setting) -> list[dict]:
    """How every training went: steps, seconds, and the mean ASSD on validation subjects in mm at every check."""
    found = []
    for start, networks in setting.there.items():
        for each in networks:
            results = read_results(each.kept(setting.configs[start], RECORD))["results"]
            own = {key: results[key] for key in ("n_steps", "n_weights", "cpu_seconds", "best_step")}
            checks = results["validations"]
            own["step"] = [check["step"] for check in checks]
            own["assd_mm"] = [check["validation_loss"] for check in checks]
            found.append({"start": start, "arm": each.arm} | own)
    return found
