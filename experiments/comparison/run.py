"""Measure the trained systems on the held-out subjects of their cohorts, and on the test-retest pairs.

Some systems have to be trained first (see ``train.py``). What is missing is listed in the results, and is measured when
the command is run again: finished subjects are kept beside the output. The rows of all subjects and pairs are written
to ``subjects.csv`` and ``pairs.csv``, from which ``tables.py`` makes the tables in ``results.json``.
"""

import dataclasses
import functools
import sys
from pathlib import Path

from measuring import PERFECT, floor_rows, pair_rows, subject_rows

from meshot.anatomy import HEMISPHERES
from meshot.model import SegmentationNetwork, network_digest
from meshot.pipeline import WEIGHTS, InitialSurfaces
from meshot.provenance import provenance, rounded
from meshot.synth import Subject, scans
from meshot.systems import SurfaceSystem
from meshot_book.measurements import MAIN, METRICS, digest_of

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment
from memory import peak_of
from tables import PAIRS, SUBJECTS, row_digests, rows_beside, tables

from trials.rates import changes_of
from trials.rows import write_rows
from trials.scanned import INITIAL, Found, Seen, reconstructed, seen
from trials.training import Training, finals, require_fair, segmentation_network, trained_system


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """What the tasks are about: trained systems by name, and scans by cohort and name."""

    config: dict
    config_file: Path
    there: dict[str, Training]
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
        if name == INITIAL:
            return None
        return trained_system(self.there[name], self.there[name].kept(self.config))


def setting_of(config: dict, config_file: Path, there: list[Training]) -> Setting:
    """Find the scans. Without the cohort of the test-retest pairs there are no pairs."""
    split = config["evaluation"]["split"]
    cohorts = dict.fromkeys(each.cohort for each in there)
    places = config["evaluation"]["cohorts"]
    subjects = {c: {each.name: each for each in scans(places[c], split)} for c in cohorts}
    place, pairs = config["consistency"], {}
    if Path(place["cohort"]).is_dir() and place["trained_on"] in cohorts:
        days: dict[str, list[Subject]] = {}
        for scan in scans(place["cohort"]):
            days.setdefault(f"{scan.participant.participant_id}_ses-{scan.session}", []).append(scan)
        pairs = {name: (day[0], day[1]) for name, day in days.items() if len(day) == 2}
    network = segmentation_network(config)
    return Setting(config, config_file, {each.name: each for each in there}, subjects, pairs, network)


def tasks_of(setting: Setting) -> list[dict]:
    """All tasks, each with a digest of what it depends on: systems on held-out scans, on pairs, and their memory."""
    digests = {
        name: digest_of(sorted(each.kept(setting.config).glob(f"*{WEIGHTS}"))) for name, each in setting.there.items()
    }
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

    def found(scan: Seen) -> Found:
        """The surfaces of the system; of a perfect one, the true ones."""
        return (scan.truths, None) if name == PERFECT else reconstructed(scan, setting.system(name))

    sides = setting.there[name].sides if name in setting.there else HEMISPHERES
    if task["what"] == "pair":
        pair = tuple(setting.seen(scan) for scan in setting.pairs[task["pair"]])
        return pair_rows(pair, found, sides, setting.config)
    scan = setting.seen(setting.subjects[task["cohort"]][task["subject"]])
    return floor_rows(scan, settings) if name == PERFECT else subject_rows(scan, found(scan), sides, settings)


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


@functools.cache
def setting(config: experiment.Config) -> Setting:
    """The trained systems and the scans."""
    there = [each for each in finals(config) if each.is_made(config)]
    if not there:
        raise ValueError(f"no trained system is in {config['weights']}: run experiments/comparison/train.py first")
    return setting_of(config, config.file, there)


def column_of(training: Training, processor: str) -> tuple:
    """The trainings with this cohort, side and make of processor are compared.

    The network that makes the initial surfaces rounds differently on each make of processor: vertices differ by some
    1e-5 mm. Systems that need these surfaces are therefore compared with those trained on the same make.
    """
    return training.cohort, training.side, processor if training.kind().needs else None


@functools.cache
def about(config: experiment.Config) -> dict:
    """What is missing, and the trainings with the origin and the size of their networks, which are checked."""
    found, trainings, columns = setting(config), [], []
    for name, each in found.there.items():
        segmentation, networks = network_digest(found.segmentation), {}
        for part, record in each.checked_records(config, changes_of(each, config), segmentation).items():
            results = record["results"]
            kept = {key: results[key] for key in ("best_step", "n_steps", "cpu_seconds", "n_weights", "data")}
            networks[part] = kept | {key: record[key] for key in ("command", "commit", "date", "machine", "processor")}
        weights = {part: digest_of([each.file(config, part, WEIGHTS)]) for part in networks}
        trainings.append(dataclasses.asdict(each) | {"name": name, "networks": networks, "weights_sha256": weights})
        first = next(iter(networks.values()))
        columns.append((name, column_of(each, first["processor"]), first["data"]))
    require_fair(columns)
    counts = {c: sum(s.participant.kind == MAIN for s in those.values()) for c, those in found.subjects.items()}
    results = {
        "missing": [each.name for each in finals(config) if each.name not in found.there],
        "too_few_subjects": {c: n for c, n in counts.items() if n < config["evaluation"]["fewest_subjects"]},
        "n_pairs": len(found.pairs),
    }
    for name, what in (("missing", "train.py makes them"), ("too_few_subjects", "make-cohort with --held-out 8")):
        if results[name]:
            print(f"{name.replace('_', ' ')} ({what}): {results[name]}", file=sys.stderr)
    return results | {"trainings": trainings}


def depends(config: experiment.Config) -> dict:
    """What the rows depend on, beside their tasks and the code. A system that joins later leaves them as they are."""
    own = {key: config[key] for key in ("evaluation", "consistency")}
    return own | {"segmentation": network_digest(setting(config).segmentation)}


def tasks(config: experiment.Config) -> list[dict]:
    """All scans and pairs, with all systems."""
    about(config)
    return tasks_of(setting(config))


def work(task: dict, config: experiment.Config) -> dict:
    """The rows of a task, and the commit that measured them."""
    return {"commit": provenance()["commit"], "rows": rows_of(task, setting(config))}


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The tables; the rows of subjects and pairs are written to files beside the results."""
    subjects, pairs, memory = lines_of(rows, setting(config))
    write_rows(config.output.with_name(SUBJECTS), subjects)
    write_rows(config.output.with_name(PAIRS), pairs)
    found = about(config)
    trainings = {"trainings": found.pop("trainings")}
    found |= {"commits": list(dict.fromkeys(row["found"]["commit"] for row in rows)), "peak_mb": memory}
    found |= {"rows_sha256": row_digests(config.output)} | trainings
    return rounded(found | tables(*rows_beside(config.output), config))


def data(config: experiment.Config) -> str:
    """The cohorts."""
    return f"held-out subjects of the synthetic cohorts {', '.join(setting(config).subjects)}"


def main(words: list[str] | None = None) -> None:
    """Do what the command line asks."""
    experiment.run(__file__, tasks, work, results, data, depends=depends, words=words)


if __name__ == "__main__":
    main()
