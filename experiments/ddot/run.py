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

import readings
from measuring import flow_row, initial_row, seen
from summary import summarised
from trainings import HERE, Wanted, record_of, segmentation_network, wanted

from meshot.model import DeformationNetwork, network_digest, read_weights
from meshot.pipeline import InitialSurfaces
from meshot.provenance import provenance, rounded
from meshot.synth import Subject, scans
from meshot_book.measurements import digest_of

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

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


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """The networks that exist, and the held-out scans of their cohorts."""

    config: dict
    there: list[Wanted]
    subjects: dict[str, dict[str, Subject]]
    surfaces: InitialSurfaces

    @functools.cached_property
    def data(self) -> dict[str, dict[str, str]]:
        """The digests of the scans."""
        return data_digests(self.subjects)

    @functools.cached_property
    def segmentation(self) -> str:
        """The digest of the network that makes the initial surfaces."""
        return network_digest(self.surfaces.network)

    @functools.lru_cache(maxsize=1)  # noqa: B019
    def hemisphere(self, cohort: str, subject: str, side: str) -> object:
        """What all flows see."""
        return seen(self.subjects[cohort][subject], side, self.surfaces, self.config["evaluation"])

    @functools.cache  # noqa: B019
    def network(self, name: str) -> tuple[DeformationNetwork, dict]:
        """A network, and the settings of its training."""
        (each,) = (each for each in self.there if each.name == name)
        network = read_weights(each.kept(self.config, ".safetensors"), DeformationNetwork)[0]
        return network, each.settings(self.config).as_dict()["training"]


@functools.cache
def setting(config: experiment.Config) -> Setting:
    """What the tasks are about.

    Raises
    ------
    ValueError
        If no network exists.
    """
    there = [each for each in wanted(config) if each.is_made(config)]
    if not there:
        raise ValueError(f"no trained network is in {config['weights']}: run experiments/ddot/train.py first")
    cohorts = dict.fromkeys(each.cohort for each in there)
    subjects = {c: {s.name: s for s in scans(config["cohorts"][c], config["evaluation"]["split"])} for c in cohorts}
    return Setting(config, there, subjects, InitialSurfaces(config["initial"], segmentation_network(config)))


@functools.cache
def about(config: experiment.Config) -> dict:
    """What is missing, and the trainings, which are checked."""
    found = setting(config)
    missing = [each.name for each in wanted(config) if each not in found.there]
    if missing:
        print(f"{len(missing)} networks are missing (train.py makes them): {', '.join(missing)}", file=sys.stderr)
    trainings = [described(each, config, found.segmentation) for each in found.there]
    require_fair(trainings)
    return {"missing": missing, "trainings": trainings}


def tasks(config: experiment.Config) -> list[dict]:
    """All held-out hemispheres, with the initial surface and each flow."""
    about(config)
    found = setting(config)
    return tasks_of(found.there, found.subjects, digests_of(found.there, config, found.segmentation), found.data)


def work(task: dict, config: experiment.Config) -> dict:
    """The row of a task, with the commit that measured it."""
    found, settings = setting(config), config["evaluation"]
    commit, scan = provenance()["commit"], found.hemisphere(task["cohort"], task["subject"], task["side"])
    if task["of"] == INITIAL:
        return {"commit": commit} | initial_row(scan, settings)
    return {"commit": commit} | flow_row(scan, *found.network(task["of"]), settings)


def results(rows: list[dict], config: experiment.Config) -> dict:
    """All rows, and their tables."""
    found, by_name = setting(config), {each.name: each for each in setting(config).there}
    commits = list(dict.fromkeys(line["found"].pop("commit") for line in rows))
    rows = [_row(line, by_name, found.subjects) for line in rows]
    summary = summarised(rows, config["evaluation"], config["comparison"])
    whole = {"missing": about(config)["missing"], "commits": commits, "data_sha256": found.data}
    return rounded(whole | summary | {"trainings": about(config)["trainings"]})


def data(config: experiment.Config) -> str:
    """The cohorts."""
    return f"held-out subjects of the synthetic cohorts {', '.join(setting(config).subjects)}"


def _row(line: dict, by_name: dict[str, Wanted], subjects: dict[str, dict[str, Subject]]) -> dict:
    """A measurement together with its subject and network."""
    place = {key: line["task"][key] for key in ("cohort", "side", "subject")}
    each = by_name.get(line["task"]["of"])
    who = {"arm": INITIAL, "seed": None} if each is None else {"arm": each.arm, "seed": each.seed}
    kind = subjects[place["cohort"]][place["subject"]].participant.kind
    return place | {"kind": kind} | who | line["found"]


def main(words: list[str] | None = None) -> None:
    """Measure the existing networks and write the results; with ``--all``, those of all protocols, too."""
    every = {"all": ("--all", {"action": "store_true", "help": "then measure the networks of all protocols, too"})}
    config = experiment.run(
        __file__, tasks, work, results, data, every, lambda config: config["evaluation"], words
    )  # fmt: skip
    for name in PROTOCOLS if config and config["all"] else ():
        place = config.output.with_name(name) / "results.json"
        readings.main(["--config", str(HERE / f"{name}.yaml"), "-o", str(place)])


if __name__ == "__main__":
    main()
