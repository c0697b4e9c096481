"""Measure the trained flows on the held-out subjects of the cohort that each was trained on.

Run as ``python experiments/ddot/run.py`` when some of the networks exist (see ``train.py``). Missing networks are
listed in the results, and are measured when the command is run again. Every finished hemisphere is stored in a file
beside the output, so that the run can be resumed or extended. ``commits`` in the results lists the commits that
measured. If the measuring code changes, everything is measured again. With ``--all`` the tables of the four protocols
(``readings.yaml`` and others, see ``readings.py``) are made from their committed weights, too; this takes some
three hours of one core.
"""

import functools
import hashlib
import json
import sys
import time
from pathlib import Path

import readings
import torch
from measuring import flow_row, initial_row, seen
from summary import summarised
from trainings import HERE, Wanted, arguments, read_config, record_of, segmentation_network, wanted

from meshot.jobs import run_jobs
from meshot.model import DeformationNetwork, SegmentationNetwork, network_digest, read_weights
from meshot.pipeline import InitialSurfaces
from meshot.provenance import provenance, rounded, write_results
from meshot.synth import Subject, scans
from meshot_book.measurements import digest_of

INITIAL = "initial"


def tasks_of(
    there: list[Wanted], subjects: dict[str, dict[str, Subject]], digests: dict[str, str],
    data: dict[str, dict[str, str]],
) -> list[dict]:  # fmt: skip
    """All held-out hemispheres: first the initial surface, then each flow for this cohort and side."""
    found = []
    for cohort, side in dict.fromkeys((each.cohort, each.side) for each in there):
        names = [INITIAL, *(each.name for each in there if (each.cohort, each.side) == (cohort, side))]
        for subject in subjects[cohort]:
            place = {"cohort": cohort, "side": side, "subject": subject, "data": data[cohort][subject]}
            found += [place | {"of": name, "digest": digests[name]} for name in names]
    return found


def data_digests(subjects: dict[str, dict[str, Subject]]) -> dict[str, dict[str, str]]:
    """A digest of all files of each subject, by cohort and subject, so that regenerated cohorts are measured again."""
    return {
        cohort: {name: digest_of(subject.files()) for name, subject in those.items()}
        for cohort, those in subjects.items()
    }


def digests_of(there: list[Wanted], config: dict, segmentation: str) -> dict[str, str]:
    """A digest of everything a measurement depends on, to detect other weights or settings."""
    settings = json.dumps(config["evaluation"], sort_keys=True).encode() + segmentation.encode()
    found = {INITIAL: settings}
    found |= {each.name: settings + each.kept(config, ".safetensors").read_bytes() for each in there}
    return {name: hashlib.sha256(content).hexdigest()[:12] for name, content in found.items()}


def measured(
    there: list[Wanted], subjects: dict[str, dict[str, Subject]], config: dict, segmentation: SegmentationNetwork,
    partial: Path, data: dict[str, dict[str, str]],
) -> list[dict]:  # fmt: skip
    """A row for every task, with the commit that measured it."""
    commit = provenance()["commit"]
    settings, by_name = config["evaluation"], {each.name: each for each in there}
    surfaces = InitialSurfaces(config["initial"], segmentation)

    @functools.lru_cache(maxsize=1)
    def hemisphere(cohort: str, subject: str, side: str) -> object:
        return seen(subjects[cohort][subject], side, surfaces, settings)

    @functools.cache
    def network(name: str) -> DeformationNetwork:
        return read_weights(by_name[name].kept(config, ".safetensors"), DeformationNetwork)[0]

    def work(task: dict) -> dict:
        found = hemisphere(task["cohort"], task["subject"], task["side"])
        if task["of"] == INITIAL:
            return {"commit": commit} | initial_row(found, settings)
        training = by_name[task["of"]].settings(config)["training"]
        return {"commit": commit} | flow_row(found, network(task["of"]), training, settings)

    tasks = tasks_of(there, subjects, digests_of(there, config, network_digest(segmentation)), data)
    return run_jobs(tasks, work, partial, folder=HERE, config=settings, clock=time.process_time)


def described(each: Wanted, config: dict, segmentation: str) -> dict:
    """The origin of a network, and its results in validation.

    Raises
    ------
    ValueError
        If it was trained on initial surfaces of another segmentation network.
    """
    record = record_of(each, config)
    if record["results"]["segmentation_sha256"] != segmentation:
        raise ValueError(f"{each.name} learned from initial surfaces of another segmentation network: train it anew")
    found = record["results"]
    (best,) = (line for line in found["validations"] if line["step"] == found["best_step"])
    kept = {key: found[key] for key in ("best_step", "n_steps", "cpu_seconds", "n_weights", "data")}
    kept |= {key: record[key] for key in ("command", "commit", "date")}
    names = {"name": each.name, "cohort": each.cohort, "side": each.side, "arm": each.arm, "seed": each.seed}
    weights = hashlib.sha256(each.kept(config, ".safetensors").read_bytes()).hexdigest()
    return names | kept | {"validation_assd_mm": best["validation_loss"], "weights_sha256": weights}


def require_fair(trainings: list[dict]) -> None:
    """Check that networks for one side of one cohort were trained on the same data.

    Raises
    ------
    ValueError
        If two of them were not.
    """
    data: dict[tuple[str, str], dict] = {}
    for each in trainings:
        first = data.setdefault((each["cohort"], each["side"]), each)
        if each["data"] != first["data"]:
            raise ValueError(f"{each['name']} learned from other data than {first['name']}: train one of them anew")


#: In this order, since the later ones share trainings with the first.
PROTOCOLS = ("readings", "candidates", "controls", "budget")


def main(words: list[str] | None = None) -> None:
    """Measure the existing networks and write the results; with ``--all``, those of all protocols, too.

    Raises
    ------
    ValueError
        If no network exists.
    """
    parser = arguments(__doc__, HERE / "results.json")
    parser.add_argument("--all", action="store_true", help="then measure the networks of all protocols, too")
    asked = parser.parse_args(words)
    config = read_config(asked.config)
    torch.set_num_threads(config["evaluation"]["n_threads"])
    planned = wanted(config)
    there = [each for each in planned if each.is_made(config)]
    missing = [each.name for each in planned if each not in there]
    if not there:
        raise ValueError(f"no trained network is in {config['weights']}: run experiments/ddot/train.py first")
    if missing:
        print(f"{len(missing)} networks are missing (train.py makes them): {', '.join(missing)}", file=sys.stderr)
    segmentation = segmentation_network(config)
    trainings = [described(each, config, network_digest(segmentation)) for each in there]
    require_fair(trainings)
    cohorts = dict.fromkeys(each.cohort for each in there)
    subjects = {c: {s.name: s for s in scans(config["cohorts"][c], config["evaluation"]["split"])} for c in cohorts}
    partial = asked.output.with_name("partial.jsonl")
    data = data_digests(subjects)
    found = measured(there, subjects, config, segmentation, partial, data)
    commits = list(dict.fromkeys(line["found"].pop("commit") for line in found))
    rows = [_row(line, {each.name: each for each in there}, subjects) for line in found]
    results = {"missing": missing, "commits": commits, "data_sha256": data}
    results |= summarised(rows, config["evaluation"], config["comparison"]) | {"trainings": trainings}
    stands_on = f"held-out subjects of the synthetic cohorts {', '.join(cohorts)}"
    seconds = sum(line["seconds"] for line in found)
    write_results(asked.output, rounded(results), config, "python experiments/ddot/run.py", stands_on, seconds)
    if not missing:
        partial.unlink()
    for name in PROTOCOLS if asked.all else ():
        place = asked.output.with_name(name) / "results.json"
        readings.main(["--config", str(HERE / f"{name}.yaml"), "-o", str(place)])


def _row(line: dict, by_name: dict[str, Wanted], subjects: dict[str, dict[str, Subject]]) -> dict:
    """A measurement together with its subject and network."""
    place = {key: line["task"][key] for key in ("cohort", "side", "subject")}
    each = by_name.get(line["task"]["of"])
    who = {"arm": INITIAL, "seed": None} if each is None else {"arm": each.arm, "seed": each.seed}
    kind = subjects[place["cohort"]][place["subject"]].participant.kind
    return place | {"kind": kind} | who | line["found"]


if __name__ == "__main__":
    main()
