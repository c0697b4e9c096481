"""The tasks of the measurement: trained systems on held-out scans, on test-retest pairs, and their memory."""

import dataclasses
import functools
from pathlib import Path

from measuring import (
    INITIAL,
    PERFECT,
    Found,
    Seen,
    floor_rows,
    pair_rows,
    reconstructed,
    seen,
    subject_rows,
    true_surfaces,
)
from memory import peak_of
from units import Unit, segmentation_network, system_in

from meshot.anatomy import HEMISPHERES
from meshot.model import SegmentationNetwork, network_digest
from meshot.pipeline import WEIGHTS, InitialSurfaces
from meshot.synth import Subject, scans
from meshot.systems import SurfaceSystem
from meshot_book.measurements import METRICS, digest_of


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """What the tasks are about: trained systems by name, and scans by cohort and name."""

    config: dict
    config_file: Path
    there: dict[str, Unit]
    subjects: dict[str, dict[str, Subject]]
    pairs: dict[str, tuple[Subject, Subject]]
    segmentation: SegmentationNetwork

    @functools.cached_property
    def surfaces(self) -> InitialSurfaces:
        """The initial surfaces of held-out subjects, apart from those of training."""
        return InitialSurfaces(Path(self.config["state"]) / "initial", self.segmentation)

    @functools.lru_cache(maxsize=2)  # noqa: B019 (there is one object in a run)
    def seen(self, subject: Subject) -> Seen:
        """A scan; the last two are kept, which the tasks need one after another."""
        return seen(subject, self.surfaces)

    @functools.cache  # noqa: B019
    def system(self, name: str) -> SurfaceSystem | None:
        """A trained system, or None for the initial surface."""
        return None if name == INITIAL else system_in(self.there[name].kept(self.config), self.there[name])


def setting_of(config: dict, config_file: Path, there: list[Unit]) -> Setting:
    """Find the scans. Without the cohort of the test-retest pairs there are no pairs."""
    split = config["evaluation"]["split"]
    cohorts = dict.fromkeys(unit.cohort for unit in there)
    places = config["evaluation"]["cohorts"]
    subjects = {c: {each.name: each for each in scans(places[c], split)} for c in cohorts}
    place, pairs = config["consistency"], {}
    if Path(place["cohort"]).is_dir() and place["trained_on"] in cohorts:
        days: dict[str, list[Subject]] = {}
        for scan in scans(place["cohort"]):
            days.setdefault(f"{scan.participant.participant_id}_ses-{scan.session}", []).append(scan)
        pairs = {name: (day[0], day[1]) for name, day in days.items() if len(day) == 2}
    network = segmentation_network(config)
    return Setting(config, config_file, {unit.name: unit for unit in there}, subjects, pairs, network)


def tasks_of(setting: Setting) -> list[dict]:
    """All tasks, each with a digest of what it depends on: systems on held-out scans, on pairs, and their memory."""
    digests = {name: digest_of(sorted(u.kept(setting.config).glob(f"*{WEIGHTS}"))) for name, u in setting.there.items()}
    digests |= dict.fromkeys((INITIAL, PERFECT), network_digest(setting.segmentation)[:12])
    found = []
    for cohort, subjects in setting.subjects.items():
        names = [INITIAL, PERFECT, *(name for name, unit in setting.there.items() if unit.cohort == cohort)]
        for subject, scan in subjects.items():
            place = {"what": "subject", "cohort": cohort, "subject": subject, "data": digest_of(scan.files())}
            found += [place | {"of": name, "digest": digests[name]} for name in names]
    trained_on = setting.config["consistency"]["trained_on"]
    first = {name: unit for name, unit in setting.there.items() if unit.is_first}
    names = [INITIAL, PERFECT, *(name for name, unit in first.items() if unit.cohort == trained_on)]
    for pair, both in setting.pairs.items():
        place = {"what": "pair", "pair": pair, "data": [digest_of(scan.files()) for scan in both]}
        found += [place | {"of": name, "digest": digests[name]} for name in names]
    for unit in {unit.arm: unit for unit in reversed(first.values())}.values():
        subject = next(iter(setting.subjects[unit.cohort]))
        found.append({"what": "memory", "of": unit.name, "subject": subject, "digest": digests[unit.name]})
    return found


def rows_of(task: dict, setting: Setting) -> list[dict]:
    """The rows of a task: one for each side, or one with the memory."""
    name, settings = task["of"], setting.config["evaluation"]
    if task["what"] == "memory":
        return [{"peak_mb": peak_of(setting.there[name], task["subject"], setting.config_file)}]
    sides = setting.there[name].sides if name in setting.there else HEMISPHERES
    if task["what"] == "pair":
        pair = tuple(setting.seen(scan) for scan in setting.pairs[task["pair"]])
        return pair_rows(pair, lambda scan: _found(scan, name, setting), sides, setting.config)
    scan = setting.seen(setting.subjects[task["cohort"]][task["subject"]])
    return (
        floor_rows(scan, settings)
        if name == PERFECT
        else subject_rows(scan, _found(scan, name, setting), sides, settings)
    )


def _found(scan: Seen, name: str, setting: Setting) -> Found:
    return true_surfaces(scan) if name == PERFECT else reconstructed(scan, setting.system(name))


def lines_of(found: list[dict], setting: Setting) -> tuple[list[dict], list[dict], dict[str, float | None]]:
    """The rows of all subjects and of all pairs with what they are of, and the peak of the memory by system."""
    subjects, pairs, memory = [], [], {}
    for line in found:
        task, unit = line["task"], setting.there.get(line["task"]["of"])
        who = {"arm": task["of"], "budget": None, "seed": None} if unit is None else {
            "arm": unit.arm, "budget": unit.budget, "seed": unit.seed}  # fmt: skip
        rows = line["found"]["rows"]
        if task["what"] == "memory":
            memory[who["arm"]] = rows[0]["peak_mb"]
        elif task["what"] == "pair":
            scan = setting.pairs[task["pair"]][0]
            about = {"subject": scan.participant.participant_id, "session": scan.session} | who
            pairs += [about | row for row in rows]
        else:
            kind = setting.subjects[task["cohort"]][task["subject"]].participant.kind
            about = {"cohort": task["cohort"], "subject": task["subject"], "kind": kind} | who
            names = ("side", *METRICS, "cpu_seconds", "failed")
            subjects += [about | {name: row.get(name) for name in names} for row in rows]
    return subjects, pairs, memory
