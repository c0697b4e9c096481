"""What a training is: cohort, side, arm, budget, seed and system; its settings, its folders, and what is kept of it.

A protocol is a YAML file. ``cohorts`` and ``segmentation`` are what is learned from, and ``settings`` those of all
systems. ``groups`` lists combinations of cohorts, sides, arms and seeds, with a budget where there are several. An
entry of ``arms`` names its system, if the arm is not called like it, and its ``changes`` of settings; where rates are
tried, the ``rates``, and in how many ``turns`` its networks are trained. ``state`` and ``weights`` are the folders of
all trainings.
"""

import argparse
import dataclasses
import fnmatch
import itertools
import json
from collections.abc import Hashable, Iterable
from pathlib import Path
from typing import ClassVar

import torch
import yaml

from meshot.anatomy import HEMISPHERES
from meshot.model import SegmentationNetwork, read_weights
from meshot.pipeline import RECORD, WEIGHTS, segmentation_weights
from meshot.provenance import read_results
from meshot.settings import Settings
from meshot.systems import SurfaceSystem, get_system, read_settings

BOTH, STEPS, SECONDS, RATE = "both", "steps", "seconds", "rate"
FIRST_SEED = 0
#: The ending of the files of last weights.
LAST = f".last{WEIGHTS}"


@dataclasses.dataclass(frozen=True)
class Training:
    """One training of one system. Its name is ``COHORT_SIDE_ARM_BUDGET_SEED``, or has no budget.

    The side is "both" if one network finds both sides. The budget is "steps", "seconds", or "rate" and a number: the
    trial of a rate. Arms with the same system differ in their settings.
    """

    cohort: str
    side: str
    arm: str
    budget: str | None
    seed: int
    system: str

    @property
    def name(self) -> str:
        """The name of its folders and files."""
        parts = (self.cohort, self.side, self.arm, self.budget, self.seed)
        return "_".join(str(part) for part in parts if part is not None)

    @property
    def sides(self) -> tuple[str, ...]:
        """The sides that it finds."""
        return HEMISPHERES if self.side == BOTH else (self.side,)

    @property
    def is_first(self) -> bool:
        """Whether it is a training at equal steps with the first seed."""
        return (self.budget, self.seed) == (STEPS, FIRST_SEED)

    @property
    def is_trial(self) -> bool:
        """Whether it is the trial of a rate."""
        return (self.budget or "").startswith(RATE)

    @property
    def rate(self) -> float:
        """The rate of a trial."""
        return float(self.budget.removeprefix(RATE))

    def state(self, config: dict) -> Path:
        """The folder of the training."""
        return Path(config["state"]) / self.name

    def kept(self, config: dict, end: str = "") -> Path:
        """The folder of its weights, records and logs. Weights of trials are not committed.

        Without a budget it has no folder: the names of its files begin with its name, and end with ``end``.
        """
        place = Path(config["state"]) / "trials" if self.is_trial else Path(config["weights"])
        return place / f"{self.name}{end}"

    def file(self, config: dict, part: str, end: str) -> Path:
        """A kept file of one of its networks: weights, record, or thinned log."""
        return self.kept(config, end) if self.budget is None else self.kept(config) / f"{part}{end}"

    def is_made(self, config: dict) -> bool:
        """Whether it is complete: its folder appears with all its files, or its record, which is written last."""
        return self.kept(config, RECORD).is_file() if self.budget is None else self.kept(config).is_dir()

    def kind(self) -> type[SurfaceSystem]:
        """The system, limited to the sides of the training."""
        return limited(get_system(self.system), self.sides)

    def parts(self, config: dict) -> tuple[str, ...]:
        """The names of its networks, which do not depend on rate and number of epochs."""
        return self.kind().parts_of(self.settings(config))

    def settings(self, config: dict, changes: Iterable[str] = ()) -> Settings:
        """All settings, with changes of rate and number of epochs (see ``rates.py``)."""
        return read_settings(get_system(self.system), config["settings"], self.changes(config, changes))

    def changes(self, config: dict, changes: Iterable[str] = ()) -> list[str]:
        """The settings that differ from those of the system."""
        arm = config["arms"][self.arm]
        return [
            *(config["changes"] if arm.get("rates") else []),
            *(config["trials"]["changes"] if self.is_trial else []),
            *arm.get("changes", []),
            *changes,
            *([f"training.side={self.side}"] if self.side != BOTH else []),
            f"training.seed={self.seed}",
        ]

    def records(self, config: dict) -> dict[str, dict]:
        """The record of each network."""
        return {part: read_results(self.file(config, part, RECORD)) for part in self.parts(config)}

    def checked_records(self, config: dict, changes: Iterable[str] = (), segmentation: str | None = None) -> dict:
        """The record of each network, with which the protocol agrees.

        ``changes`` are those of rate and number of epochs; ``segmentation`` is the digest of the network that made the
        initial surfaces.
        """
        wanted, found = self.settings(config, changes), self.records(config)
        for part, record in found.items():
            path = self.file(config, part, RECORD)
            # Settings introduced after the record have their defaults.
            try:
                trained = self.kind().complete(record["config"])
            except ValueError as error:
                raise ValueError(f"{path}: {error}") from error
            if trained != wanted:
                raise ValueError(f"{path} was trained with other settings than the protocol's: train it anew")
            other = record["results"].get("segmentation_sha256", segmentation)
            if segmentation and self.kind().needs and other != segmentation:
                raise ValueError(
                    f"{self.name} learned from initial surfaces of another segmentation network: train it anew"
                )
        return found


def limited(kind: type[SurfaceSystem], sides: Iterable[str]) -> type[SurfaceSystem]:
    """A system that finds, needs and has networks for the given sides only. Unchanged if a network finds both sides."""
    if set(sides) == set(HEMISPHERES) or not has_sides(kind):
        return kind
    prefixes = tuple(f"{side}_" for side in sides)

    class Limited(kind):
        needs = tuple(key for key in kind.needs if key[0] in sides)
        networks: ClassVar = {name: of for name, of in kind.networks.items() if name.startswith(prefixes)}

        @classmethod
        def surfaces_of(cls, settings: Settings) -> tuple:
            return tuple(key for key in kind.surfaces_of(settings) if key[0] in sides)

        @classmethod
        def parts_of(cls, settings: Settings) -> tuple[str, ...]:
            return tuple(name for name in kind.parts_of(settings) if name in cls.networks)

    return Limited


def has_sides(kind: type[SurfaceSystem]) -> bool:
    """Whether a system has networks for each side, which are trained apart."""
    return all(name.startswith(tuple(f"{side}_" for side in HEMISPHERES)) for name in kind.networks)


def training_of(cohort: str, side: str, arm: str, budget: str | None, seed: int, config: dict) -> Training:
    """The training that gives the surfaces of one column. An arm that names no system has the name of its system."""
    system = config["arms"][arm].get("system", arm)
    return Training(cohort, side if has_sides(get_system(system)) else BOTH, arm, budget, seed, system)


def trials(config: dict) -> list[Training]:
    """One training for each rate of each system whose rates are tried."""
    place = config.get("trials")
    return [
        training_of(place["cohort"], place["side"], arm, f"{RATE}{rate:g}", place["seed"], config)
        for arm, entry in config["arms"].items()
        for rate in entry.get("rates") or ()
    ]


def finals(config: dict) -> list[Training]:
    """The trainings that are measured, each once, in the order in which they are made."""
    found = (
        training_of(cohort, side, arm, group.get("budget"), seed, config)
        for group in config["groups"].values()
        for cohort, side, seed, arm in itertools.product(*(group[key] for key in ("cohorts", "sides", "seeds", "arms")))
    )
    return list(dict.fromkeys(found))


def chosen(trainings: list[Training], only: Iterable[str]) -> list[Training]:
    """The trainings whose names match one of the patterns."""
    found = [each for each in trainings if any(fnmatch.fnmatchcase(each.name, pattern) for pattern in only)]
    if not found:
        raise ValueError(f"no training is called {' or '.join(only)}; there are {', '.join(e.name for e in trainings)}")
    return found


def require_fair(trainings: Iterable[tuple[str, Hashable, object]]) -> None:
    """Check that what is compared was trained on the same data: name, column of the comparison, and data of each."""
    found: dict[Hashable, tuple[str, object]] = {}
    for name, column, data in trainings:
        first, same = found.setdefault(column, (name, data))
        if data != same:
            raise ValueError(f"{name} learned from other data than {first}: train one of them anew")


def trained_system(training: Training, folder: Path, device: torch.device | None = None) -> SurfaceSystem:
    """The trained system in a folder. The records of its networks give the settings of the reconstruction."""
    found = training.kind().load(folder)
    for part in found.parts.values():
        part.network.to(device)
    return found


def segmentation_network(config: dict) -> SegmentationNetwork:
    """The network that makes the initial surfaces."""
    return read_weights(segmentation_weights(config["segmentation"]), SegmentationNetwork)[0]


def arguments(about: str, folder: Path, output: str = "") -> argparse.ArgumentParser:
    """The arguments of the commands in the folder of an experiment. ``output`` is the default of ``-o``, if any."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=folder / "config.yaml", help="in place of config.yaml")
    if output:
        parser.add_argument("-o", "--output", type=Path, default=folder / output, help="the file for the result")
    return parser


def read_config(path: Path) -> dict:
    """A protocol."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def read_json(path: Path) -> dict:
    """A small file of a training."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is not whole JSON ({error}); remove its folder, and run train.py again") from error
