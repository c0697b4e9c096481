"""Measure the trained systems on the held-out subjects of their cohorts, and on the test-retest pairs.

Some systems have to be trained first (see ``train.py``). What is missing is listed in the results, and is measured when
the command is run again: finished subjects are kept beside the output. The rows of all subjects and pairs are written
to ``subjects.csv`` and ``pairs.csv``, from which ``tables.py`` makes the tables in ``results.json``.
"""

import dataclasses
import functools
import sys
from pathlib import Path

from budgets import changes_of
from held_out import Setting, lines_of, rows_of, setting_of, tasks_of
from rows import write_rows
from tables import MAIN, PAIRS, SUBJECTS, row_digests, rows_beside, tables
from units import Unit, finals, records_in

from meshot.model import network_digest
from meshot.pipeline import WEIGHTS
from meshot.provenance import provenance, rounded
from meshot_book.measurements import digest_of

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def described(unit: Unit, setting: Setting) -> dict:
    """The origin of a trained system, and its size.

    Raises
    ------
    ValueError
        If it was trained with other settings, or on initial surfaces of another segmentation network.
    """
    config, about = setting.config, dataclasses.asdict(unit) | {"name": unit.name}
    wanted, networks = unit.settings(config, changes_of(unit, config)), {}
    for part, record in records_in(unit.kept(config), unit, config).items():
        results = record["results"]
        # Settings introduced after the record have their defaults.
        if unit.kind().complete(record["config"]) != wanted:
            raise ValueError(f"{unit.name} was trained with other settings than the protocol's: train it anew")
        other = results.get("segmentation_sha256", network_digest(setting.segmentation))
        if unit.kind().needs and other != network_digest(setting.segmentation):
            raise ValueError(
                f"{unit.name} learned from initial surfaces of another segmentation network: train it anew"
            )
        kept = {key: results[key] for key in ("best_step", "n_steps", "cpu_seconds", "n_weights", "data")}
        networks[part] = kept | {key: record[key] for key in ("command", "commit", "date", "machine", "processor")}
    weights = {part: digest_of([unit.kept(config) / f"{part}{WEIGHTS}"]) for part in networks}
    return about | {"networks": networks, "weights_sha256": weights}


def require_fair(trainings: list[dict], setting: Setting) -> None:
    """Check that systems with the same input were trained on the same data.

    The network that makes the initial surfaces rounds differently on each make of processor: vertices differ by some
    1e-5 mm. Systems that need these surfaces are therefore compared with those trained on the same make.

    Raises
    ------
    ValueError
        If two of them were not.
    """
    data: dict[tuple, dict] = {}
    for each in trainings:
        make = None
        if setting.there[each["name"]].kind().needs:
            make = next(iter(each["networks"].values()))["processor"]
        first = data.setdefault((each["cohort"], each["side"], make), each)
        one, other = (next(iter(training["networks"].values()))["data"] for training in (first, each))
        if one != other:
            raise ValueError(f"{each['name']} learned from other data than {first['name']}: train one of them anew")


def too_few(setting: Setting) -> dict[str, int]:
    """The cohorts with fewer held-out subjects from the template than the protocol asks for, and how many there are."""
    counts = {c: sum(s.participant.kind == MAIN for s in those.values()) for c, those in setting.subjects.items()}
    return {c: n for c, n in counts.items() if n < setting.config["evaluation"]["fewest_subjects"]}


@functools.cache
def setting(config: experiment.Config) -> Setting:
    """The trained systems and the scans.

    Raises
    ------
    ValueError
        If nothing is trained.
    """
    there = [unit for unit in finals(config) if unit.is_made(config)]
    if not there:
        raise ValueError(f"no trained system is in {config['weights']}: run experiments/comparison/train.py first")
    return setting_of(config, config.file, there)


@functools.cache
def about(config: experiment.Config) -> dict:
    """What is missing, and the trainings, which are checked."""
    found = setting(config)
    trainings = [described(unit, found) for unit in found.there.values()]
    require_fair(trainings, found)
    missing = [unit.name for unit in finals(config) if unit.name not in found.there]
    results = {"missing": missing, "too_few_subjects": too_few(found), "n_pairs": len(found.pairs)}
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
