"""Measurements of the networks of a protocol, with their best and with their last weights, on subjects of all splits.

Distances are those of ``measuring.py``, in scanner space and without repair. The loss of a network is that of its last
step, between the coarse surface of the training and the true one, with directions, samples or windows of one seed. The
tables have means, paired differences over held-out subjects, and which losses help.
"""

import dataclasses
import functools
import hashlib
import json
from collections.abc import Iterator

import numpy as np

from meshot.mesh import Mesh
from meshot.metrics import evaluate
from meshot.model import DeformationNetwork, SegmentationNetwork, network_digest, read_weights
from meshot.pipeline import RECORD, WEIGHTS, InitialSurfaces, in_scanner
from meshot.provenance import read_results
from meshot.synth import Subject, scans
from meshot.systems import DeformationExample, deformed, hemisphere_example
from meshot.volume import StandardScan
from meshot_book.measurements import COMPARED, MAIN, METRICS, digest_of, grouped, metric_values, paired_gaps, spread
from trials.training import LAST, Training

#: The two kinds of weights of a network, with the endings of their files.
WHICH = {"best": WEIGHTS, "last": LAST}
START = "start"
LOSSES = ("loss_before", "loss_after")


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """What is measured: the networks by start, each with its configuration, on the subjects by split."""

    protocol: dict
    configs: dict[str, dict]
    there: dict[str, list[Training]]
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
    def seen(self, split: str, name: str, start: str, n_faces: int) -> tuple[StandardScan, DeformationExample, Mesh]:
        """A hemisphere: in standard space as in a training, and its true surface in scanner space.

        The last one is kept, which the tasks need one after another.
        """
        subject, side = self.subjects[split][name], self.protocol["side"]
        surfaces, keys = InitialSurfaces(self.configs[start]["initial"], self.segmentation), [(side, "white")]
        example = hemisphere_example(surfaces.example(subject, keys, keys), side, n_faces)
        return subject.standard(), example, subject.surface("white", side)


def tasks_of(setting: Setting) -> Iterator[dict]:
    """All tasks: for every subject and start the initial surface, and both kinds of weights of every network."""
    for split, those in setting.subjects.items():
        for subject, scan in those.items():
            place = {"split": split, "subject": subject, "data": digest_of(scan.files())}
            for start, networks in setting.there.items():
                own, config = place | {"start": start}, setting.configs[start]
                yield own | {"digest": network_digest(setting.segmentation)[:12], "arm": START, "weights": None}
                for each in networks:
                    text = json.dumps(each.settings(config).as_dict())
                    settings = {"settings": hashlib.sha256(text.encode()).hexdigest()[:12]}
                    for which, ending in WHICH.items():
                        digest = digest_of([each.kept(config, ending)])
                        yield own | {"digest": digest, "arm": each.arm, "weights": which} | settings


def row_of(task: dict, setting: Setting) -> dict:
    """The metrics of a start, or after a flow with the loss of the network before and after it.

    ``failed`` says why if the flow diverges.
    """
    settings, networks = setting.protocol["evaluation"], setting.there[task["start"]]
    each = next(each for each in networks if task["arm"] in (each.arm, START))
    own = setting.configs[task["start"]]
    config = each.settings(own)
    scan, example, truth = setting.seen(task["split"], task["subject"], task["start"], config.training.n_faces)

    def measured(mesh: Mesh) -> dict[str, float]:
        points = settings["n_points"], settings["seed"], settings["n_emd_points"]
        return metric_values(evaluate(in_scanner(mesh, scan), truth, *points, floors=False))

    if task["arm"] == START:
        return measured(example.initial)
    network = read_weights(each.kept(own, WHICH[task["weights"]]), DeformationNetwork)[0]
    flow = (config.training.n_flow_steps, config.training.method)
    try:
        whole = deformed(example.initial, example.scan, network, *flow)
        coarse = deformed(example.coarse, example.scan, network, *flow, standard=example.initial)
    except ValueError as error:
        return {"failed": str(error)}
    loss = config.loss.at(1.0)  # that of the last step of a training
    return measured(whole) | {
        name: float(loss(mesh, example.target, np.random.default_rng(settings["seed"])))
        for name, mesh in zip(LOSSES, (example.coarse, coarse))
    }


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


def tables(rows: list[dict], readings: dict[str, dict], rival: str) -> dict:
    """Means, differences, and for every reading whether its loss helps, and whether it beats its rival.

    ``rival`` is the rival of readings that name none.
    """
    place, means = ("start", "arm", "weights", "split", "kind"), []
    for part in grouped(rows, place):
        there = [row for row in part if "failed" not in row]
        about = {key: part[0][key] for key in place} | {"n_subjects": len(there), "n_failed": len(part) - len(there)}
        names = [key for key in (*METRICS, *LOSSES) if there and key in there[0]]
        means.append(about | {key: spread([row[key] for row in there]) for key in names})
    held_out = [row for row in rows if (row["split"], row["kind"]) == ("test", MAIN)]
    gaps = differences(held_out, {name: each.get("rival", rival) for name, each in readings.items()})
    # A reading helps if it is nearer than its start, and beats if nearer than its rival. Nearer: the interval of the
    # difference in ASSD lies below zero, and the flow did not fail on any subject.
    failed = {(row["arm"], row["weights"]) for row in held_out if "failed" in row}
    decided: dict[str, dict[str, dict[str, bool]]] = {}
    for gap in gaps:
        name = "helps" if gap["second"] == START else "beats"
        own = decided.setdefault(gap["first"], {which: {} for which in WHICH})
        own[gap["weights"]][name] = (gap["first"], gap["weights"]) not in failed and gap["assd_mm"]["high"] < 0
    return {"means": means, "differences": gaps, "decided": decided}


def differences(rows: list[dict], rivals: dict[str, str]) -> list[dict]:
    """Every reading minus its start, and minus its rival with the same kind of weights, paired over subjects."""
    by_arm: dict[tuple, dict[str, dict]] = {}
    for row in rows:
        if "failed" not in row:
            by_arm.setdefault((row["start"], row["arm"], row["weights"]), {})[row["subject"]] = row
    found = []
    for (start, arm, which), own in by_arm.items():
        others = {START: by_arm.get((start, START, None), {})} if arm != START else {}
        if rivals.get(arm, arm) != arm:
            others[rivals[arm]] = next(
                (those for (_, name, weights), those in by_arm.items() if (name, weights) == (rivals[arm], which)), {}
            )
        about = {"start": start, "first": arm, "weights": which}
        for name, those in others.items():
            if gaps := paired_gaps(own, those, COMPARED):
                found.append(about | {"second": name, "n_subjects": len(own.keys() & those.keys())} | gaps)
    return found
