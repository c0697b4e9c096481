"""Measure the trained flows on the held-out subjects of the cohort that each was trained on.

Some of the networks have to be trained first (see ``train.py``). Missing networks are listed in the results, and are
measured when the command is run again: finished hemispheres are kept beside the output. ``commits`` lists the commits
that measured. If the measuring code changes, everything is measured again. With ``--all`` the tables of the four
protocols (``readings.yaml`` and others, see ``readings.py``) are made from their committed weights, too; this takes
some three hours of one core.
"""

import dataclasses
import functools
import hashlib
import json
import sys
from pathlib import Path

from measuring import Seen, flow_row, initial_row, seen
from summary import INITIAL, summarised

from meshot.model import DeformationNetwork, network_digest, read_weights
from meshot.pipeline import WEIGHTS, InitialSurfaces
from meshot.provenance import provenance, rounded
from meshot.synth import Subject, scans
from meshot_book.measurements import digest_of

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment
import readings

from trials.training import Training, finals, require_fair, segmentation_network

#: In this order, since the later ones share trainings with the first.
PROTOCOLS = ("readings", "candidates", "controls", "budget")


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """The networks that exist, and the held-out scans of their cohorts."""

    config: dict
    there: list[Training]
    subjects: dict[str, dict[str, Subject]]
    surfaces: InitialSurfaces

    @functools.cached_property
    def data(self) -> dict[str, dict[str, str]]:
        """A digest of all files of each subject, by cohort and subject: regenerated cohorts are measured again."""
        found = self.subjects.items()
        return {c: {name: digest_of(subject.files()) for name, subject in those.items()} for c, those in found}

    @functools.cached_property
    def segmentation(self) -> str:
        """The digest of the network that makes the initial surfaces."""
        return network_digest(self.surfaces.network)

    @functools.lru_cache(maxsize=1)  # noqa: B019
    def hemisphere(self, cohort: str, subject: str, side: str) -> Seen:
        """What all flows see."""
        return seen(self.subjects[cohort][subject], side, self.surfaces, self.config["evaluation"])

    @functools.cache  # noqa: B019
    def network(self, name: str) -> tuple[DeformationNetwork, dict]:
        """A network, and the settings of its training."""
        (each,) = (each for each in self.there if each.name == name)
        network = read_weights(each.kept(self.config, WEIGHTS), DeformationNetwork)[0]
        return network, each.settings(self.config).as_dict()["training"]


@functools.cache
def setting(config: experiment.Config) -> Setting:
    """What the tasks are about."""
    there = [each for each in finals(config) if each.is_made(config)]
    if not there:
        raise ValueError(f"no trained network is in {config['weights']}: run experiments/ddot/train.py first")
    cohorts = dict.fromkeys(each.cohort for each in there)
    subjects = {c: {s.name: s for s in scans(config["cohorts"][c], config["evaluation"]["split"])} for c in cohorts}
    return Setting(config, there, subjects, InitialSurfaces(config["initial"], segmentation_network(config)))


@functools.cache
def about(config: experiment.Config) -> dict:
    """What is missing, and the trainings, which are checked."""
    found = setting(config)
    missing = [each.name for each in finals(config) if each not in found.there]
    if missing:
        print(f"{len(missing)} networks are missing (train.py makes them): {', '.join(missing)}", file=sys.stderr)
    trainings, columns = [], []
    for each in found.there:
        (record,) = each.checked_records(config, segmentation=found.segmentation).values()
        results = record["results"]
        (best,) = (line for line in results["validations"] if line["step"] == results["best_step"])
        about = {key: getattr(each, key) for key in ("name", "cohort", "side", "arm", "seed")}
        about |= {key: results[key] for key in ("best_step", "n_steps", "cpu_seconds", "n_weights", "data")}
        about |= {key: record[key] for key in ("command", "commit", "date")}
        weights = hashlib.sha256(each.kept(config, WEIGHTS).read_bytes()).hexdigest()
        trainings.append(about | {"validation_assd_mm": best["validation_loss"], "weights_sha256": weights})
        columns.append((each.name, (each.cohort, each.side), results["data"]))
    require_fair(columns)
    return {"missing": missing, "trainings": trainings}


def tasks(config: experiment.Config) -> list[dict]:
    """All held-out hemispheres: first the initial surface, then each flow for this cohort and side."""
    about(config)
    return tasks_of(setting(config))


def tasks_of(setting: Setting) -> list[dict]:
    """The tasks, each with a digest of what it depends on: weights, settings, and the network of initial surfaces."""
    same = json.dumps(setting.config["evaluation"], sort_keys=True).encode() + setting.segmentation.encode()
    depends = {INITIAL: same}
    depends |= {each.name: same + each.kept(setting.config, WEIGHTS).read_bytes() for each in setting.there}
    digests = {name: hashlib.sha256(content).hexdigest()[:12] for name, content in depends.items()}
    found = []
    for cohort, side in dict.fromkeys((each.cohort, each.side) for each in setting.there):
        names = [INITIAL, *(each.name for each in setting.there if (each.cohort, each.side) == (cohort, side))]
        for subject in setting.subjects[cohort]:
            place = {"cohort": cohort, "side": side, "subject": subject, "data": setting.data[cohort][subject]}
            found += [place | {"of": name, "digest": digests[name]} for name in names]
    return found


def work(task: dict, config: experiment.Config) -> dict:
    """The row of a task, with the commit that measured it."""
    found, settings = setting(config), config["evaluation"]
    commit, scan = provenance()["commit"], found.hemisphere(task["cohort"], task["subject"], task["side"])
    if task["of"] == INITIAL:
        return {"commit": commit} | initial_row(scan, settings)
    return {"commit": commit} | flow_row(scan, *found.network(task["of"]), settings)


def results(rows: list[dict], config: experiment.Config) -> dict:
    """All rows with their subjects and networks, and their tables."""
    found, measured = setting(config), []
    by_name = {each.name: each for each in found.there}
    commits = list(dict.fromkeys(line["found"].pop("commit") for line in rows))
    for line in rows:
        place = {key: line["task"][key] for key in ("cohort", "side", "subject")}
        each = by_name.get(line["task"]["of"])
        who = {"arm": INITIAL, "seed": None} if each is None else {"arm": each.arm, "seed": each.seed}
        kind = found.subjects[place["cohort"]][place["subject"]].participant.kind
        measured.append(place | {"kind": kind} | who | line["found"])
    summary = summarised(measured, config["evaluation"], config["comparison"])
    whole = {"missing": about(config)["missing"], "commits": commits, "data_sha256": found.data}
    return rounded(whole | summary | {"trainings": about(config)["trainings"]})


def data(config: experiment.Config) -> str:
    """The cohorts."""
    return f"held-out subjects of the synthetic cohorts {', '.join(setting(config).subjects)}"


def main(words: list[str] | None = None) -> None:
    """Measure the existing networks and write the results; with ``--all``, those of all protocols, too."""
    every = {"all": ("--all", {"action": "store_true", "help": "then measure the networks of all protocols, too"})}
    config = experiment.run(__file__, tasks, work, results, data, every, lambda own: own["evaluation"], words)
    for name in PROTOCOLS if config and config["all"] else ():
        place = config.output.with_name(name) / "results.json"
        readings.main(["--config", str(readings.HERE / f"{name}.yaml"), "-o", str(place)])


if __name__ == "__main__":
    main()
