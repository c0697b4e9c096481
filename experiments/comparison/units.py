"""The trainings of the experiment: their names, settings, order, and the folders in which they are kept."""

import argparse
import dataclasses
import fnmatch
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import ClassVar

import torch
import yaml

from meshot.anatomy import HEMISPHERES
from meshot.model import SegmentationNetwork, read_weights
from meshot.pipeline import RECORD, segmentation_weights
from meshot.provenance import read_results
from meshot.settings import Settings
from meshot.systems import SurfaceSystem, get_system, read_settings

HERE = Path(__file__).parent
BOTH, STEPS, SECONDS, RATE = "both", "steps", "seconds", "rate"
FIRST_SEED = 0


@dataclasses.dataclass(frozen=True)
class Unit:
    """One training of one system. Its name is ``COHORT_SIDE_ARM_BUDGET_SEED``.

    The side is "both" if one network finds both sides. The budget is "steps", "seconds", or "rate" and a number: the
    trial of a rate. Arms with the same system differ in their settings.
    """

    cohort: str
    side: str
    arm: str
    budget: str
    seed: int
    system: str

    @property
    def name(self) -> str:
        """The name of its folders."""
        return f"{self.cohort}_{self.side}_{self.arm}_{self.budget}_{self.seed}"

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
        return self.budget.startswith(RATE)

    @property
    def rate(self) -> float:
        """The rate of a trial."""
        return float(self.budget.removeprefix(RATE))

    def state(self, config: dict) -> Path:
        """The folder of the training."""
        return Path(config["state"]) / self.name

    def kept(self, config: dict) -> Path:
        """The folder of its weights, records and logs. Weights of trials are not committed."""
        return (Path(config["state"]) / "trials" if self.is_trial else Path(config["weights"])) / self.name

    def is_made(self, config: dict) -> bool:
        """Whether it is complete; the folder appears at the end, with all its files."""
        return self.kept(config).is_dir()

    def kind(self) -> type[SurfaceSystem]:
        """The system, limited to the sides of the training."""
        return limited(get_system(self.system), self.sides)

    def parts(self, config: dict) -> tuple[str, ...]:
        """The names of its networks, which do not depend on rate and number of epochs."""
        return self.kind().parts_of(self.settings(config, ()))

    def settings(self, config: dict, changes: Iterable[str]) -> Settings:
        """All settings, with changes of rate and number of epochs (see ``budgets.py``)."""
        return read_settings(get_system(self.system), config["settings"], self.all_changes(config, changes))

    def all_changes(self, config: dict, changes: Iterable[str]) -> list[str]:
        """The settings that differ from those of the system."""
        own = [] if config["arms"][self.arm]["rates"] is None else config["changes"]
        side = [f"training.side={self.side}"] if self.side != BOTH else []
        trial = config["trials"]["changes"] if self.is_trial else []
        return [
            *own,
            *trial,
            *config["arms"][self.arm].get("changes", []),
            *changes,
            *side,
            f"training.seed={self.seed}",
        ]


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


def unit_of(cohort: str, side: str, arm: str, budget: str, seed: int, config: dict) -> Unit:
    """The training that gives the surfaces of one column. An arm that names no system has the name of its system."""
    system = config["arms"][arm].get("system", arm)
    return Unit(cohort, side if has_sides(get_system(system)) else BOTH, arm, budget, seed, system)


def trials(config: dict) -> list[Unit]:
    """One training for each rate of each system."""
    place = config["trials"]
    return [
        unit_of(place["cohort"], place["side"], arm, f"{RATE}{rate:g}", place["seed"], config)
        for arm, entry in config["arms"].items()
        for rate in entry["rates"] or ()
    ]


def finals(config: dict) -> list[Unit]:
    """The trainings that are measured, each once, in the order in which they are made."""
    return list(dict.fromkeys(_of_groups(config)))


def _of_groups(config: dict) -> Iterator[Unit]:
    for group in config["groups"].values():
        for cohort in group["cohorts"]:
            for side in group["sides"]:
                for seed in group["seeds"]:
                    for arm in group["arms"]:
                        yield unit_of(cohort, side, arm, group["budget"], seed, config)


def chosen(units: list[Unit], only: Iterable[str]) -> list[Unit]:
    """The trainings whose names match one of the patterns.

    Raises
    ------
    ValueError
        If none matches.
    """
    found = [each for each in units if any(fnmatch.fnmatchcase(each.name, pattern) for pattern in only)]
    if not found:
        raise ValueError(f"no training is called {' or '.join(only)}; there are {', '.join(e.name for e in units)}")
    return found


def system_in(folder: Path, unit: Unit, device: torch.device | None = None) -> SurfaceSystem:
    """The trained system in a folder. The records of its networks give the settings of the reconstruction."""
    found = unit.kind().load(folder)
    for part in found.parts.values():
        part.network.to(device)
    return found


def records_in(folder: Path, unit: Unit, config: dict) -> dict[str, dict]:
    """The record of each network of a training."""
    return {name: read_results(folder / f"{name}{RECORD}") for name in unit.parts(config)}


def segmentation_network(config: dict) -> SegmentationNetwork:
    """The network that makes the initial surfaces."""
    return read_weights(segmentation_weights(config["segmentation"]), SegmentationNetwork)[0]


def arguments(about: str) -> argparse.ArgumentParser:
    """The argument of all commands of the experiment."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=HERE / "config.yaml", help="in place of config.yaml")
    return parser


def read_config(path: Path = HERE / "config.yaml") -> dict:
    """The configuration of the experiment."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def read_json(path: Path) -> dict:
    """A small file of this experiment.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is not whole JSON ({error}); remove its folder, and run train.py again") from error
