"""Measure the trained systems on the held-out subjects of their cohorts, and on the test-retest pairs.

Run as ``python experiments/comparison/run.py`` when some systems are trained (see ``train.py``). What is missing is
listed in the results, and is measured when the command is run again. Every finished subject is stored in a file beside
the output, so that the run can be resumed or extended. The rows of all subjects and pairs are written to
``subjects.csv`` and ``pairs.csv``, from which ``tables.py`` makes the tables in ``results.json``.
"""

import dataclasses
import sys
import time
from pathlib import Path

import torch
from budgets import changes_of
from held_out import Setting, lines_of, rows_of, setting_of, tasks_of
from rows import write_rows
from tables import MAIN, PAIRS, RESULTS, SUBJECTS, row_digests, rows_beside, tables
from units import HERE, Unit, arguments, finals, read_config, records_in

from meshot.jobs import run_jobs
from meshot.model import network_digest
from meshot.pipeline import WEIGHTS
from meshot.provenance import provenance, rounded, write_results
from meshot_book.measurements import digest_of


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


def measured_with(setting: Setting) -> dict:
    """What the rows depend on, beside their tasks and the code. A system that joins later leaves them as they are."""
    own = {key: setting.config[key] for key in ("evaluation", "consistency")}
    return own | {"segmentation": network_digest(setting.segmentation)}


def main(words: list[str] | None = None) -> None:
    """Measure what is there, then write rows and tables.

    Raises
    ------
    ValueError
        If nothing is trained.
    """
    parser = arguments(__doc__)
    parser.add_argument("-o", "--output", type=Path, default=HERE / RESULTS, help="the file for the result")
    asked = parser.parse_args(words)
    config, commit = read_config(asked.config), provenance()["commit"]
    torch.set_num_threads(config["evaluation"]["n_threads"])
    planned = finals(config)
    there = [unit for unit in planned if unit.is_made(config)]
    missing = [unit.name for unit in planned if unit not in there]
    if not there:
        raise ValueError(f"no trained system is in {config['weights']}: run experiments/comparison/train.py first")
    setting = setting_of(config, asked.config, there)
    trainings = [described(unit, setting) for unit in there]
    require_fair(trainings, setting)
    results = {"missing": missing, "too_few_subjects": too_few(setting), "n_pairs": len(setting.pairs)}
    for name, what in (("missing", "train.py makes them"), ("too_few_subjects", "make-cohort with --held-out 8")):
        if results[name]:
            print(f"{name.replace('_', ' ')} ({what}): {results[name]}", file=sys.stderr)
    partial = asked.output.with_name("partial.jsonl")
    found = run_jobs(
        tasks_of(setting), lambda task: {"commit": commit, "rows": rows_of(task, setting)}, partial,
        folder=HERE, config=measured_with(setting), clock=time.process_time,
    )  # fmt: skip
    subjects, pairs, memory = lines_of(found, setting)
    write_rows(asked.output.with_name(SUBJECTS), subjects)
    write_rows(asked.output.with_name(PAIRS), pairs)
    results |= {"commits": list(dict.fromkeys(line["found"]["commit"] for line in found)), "peak_mb": memory}
    results |= {"rows_sha256": row_digests(asked.output), "trainings": trainings}
    results |= tables(*rows_beside(asked.output), config)
    stands_on = f"held-out subjects of the synthetic cohorts {', '.join(setting.subjects)}"
    seconds = sum(line["seconds"] for line in found)
    write_results(asked.output, rounded(results), config, "python experiments/comparison/run.py", stands_on, seconds)
    if not missing:
        partial.unlink()


if __name__ == "__main__":
    main()
