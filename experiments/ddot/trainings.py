"""The networks of the experiment, their order, and the files that are stored for each."""

import argparse
import dataclasses
import fnmatch
from collections.abc import Iterable
from pathlib import Path

import yaml

from meshot.files import whole_file
from meshot.model import DeformationNetwork, SegmentationNetwork, read_weights, write_weights
from meshot.pipeline import LOG, RECORD, STATE_FOLDER, WEIGHTS, segmentation_weights
from meshot.provenance import read_results
from meshot.settings import Settings
from meshot.systems import SurfaceSystem, get_system, read_settings
from meshot.train import TrainingLog, TrainingState, read_log
from meshot_book.trainings import thinned

HERE = Path(__file__).parent
#: The ending of the files of last weights.
LAST = f".last{WEIGHTS}"


@dataclasses.dataclass(frozen=True)
class Wanted:
    """A network of the experiment. Its name is ``COHORT_SIDE_ARM_SEED``."""

    cohort: str
    side: str
    arm: str
    seed: int

    @property
    def name(self) -> str:
        """The base name of its files."""
        return f"{self.cohort}_{self.side}_{self.arm}_{self.seed}"

    @property
    def part(self) -> str:
        """The part of the system that is trained."""
        return f"{self.side}_white"

    def system(self, config: dict) -> type[SurfaceSystem]:
        """The system of the arm, or the one that it is a variant of."""
        return get_system(config["arms"][self.arm]["system"])

    def changes(self, config: dict) -> list[str]:
        """The settings that differ from those of the system."""
        own = config["arms"][self.arm].get("changes", [])
        return [*own, f"training.side={self.side}", f"training.seed={self.seed}"]

    def settings(self, config: dict) -> Settings:
        """All settings."""
        return read_settings(self.system(config), config["settings"], self.changes(config))

    def state(self, config: dict) -> Path:
        """The folder of the training."""
        return Path(config["state"]) / self.name

    def kept(self, config: dict, suffix: str) -> Path:
        """A stored file: ``.safetensors``, ``.json`` (the record) or ``.log.jsonl`` (the thinned log)."""
        return Path(config["weights"]) / f"{self.name}{suffix}"

    def is_made(self, config: dict) -> bool:
        """Whether it is complete; the record is written last."""
        return self.kept(config, ".json").is_file()


def arguments(about: str, output: Path | None = None) -> argparse.ArgumentParser:
    """The arguments of all commands of the experiment. ``output`` is the default of ``-o``, if there is one file."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=HERE / "config.yaml", help="in place of config.yaml")
    if output is not None:
        parser.add_argument("-o", "--output", type=Path, default=output, help="the file for the result")
    return parser


def read_config(path: Path = HERE / "config.yaml") -> dict:
    """The configuration of the experiment."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def wanted(config: dict, only: Iterable[str] = ("*",)) -> list[Wanted]:
    """The networks whose names match one of the patterns, each once, in the order in which they are made.

    Raises
    ------
    ValueError
        If none matches.
    """
    found = {
        Wanted(cohort, side, arm, seed): None
        for group in config["groups"].values()
        for cohort in group["cohorts"]
        for side in group["sides"]
        for seed in group["seeds"]
        for arm in group["arms"]
    }
    chosen = [each for each in found if any(fnmatch.fnmatchcase(each.name, pattern) for pattern in only)]
    if not chosen:
        names = ", ".join(each.name for each in found)
        raise ValueError(f"no training is called {' or '.join(only)}; there are {names}")
    return chosen


def segmentation_network(config: dict) -> SegmentationNetwork:
    """The network that makes the initial surfaces."""
    return read_weights(segmentation_weights(config["segmentation"]), SegmentationNetwork)[0]


def keep(each: Wanted, config: dict) -> None:
    """Copy weights, record and thinned log to their final place. The record is last and marks completion.

    With ``keep_last`` in the configuration, the last weights are kept beside the best ones.
    """
    folder = each.state(config)
    if config.get("keep_last"):
        network, record = read_weights(folder / f"{each.part}{WEIGHTS}", DeformationNetwork)
        network.load_state_dict(TrainingState.read_last_weights(folder / STATE_FOLDER / each.part))
        write_weights(each.kept(config, LAST), network, record)
    TrainingLog(each.kept(config, LOG), thinned(read_log(folder / f"{each.part}{LOG}")))
    for suffix in (WEIGHTS, RECORD):
        with whole_file(each.kept(config, suffix)) as temporary:
            temporary.write_bytes((folder / f"{each.part}{suffix}").read_bytes())


def record_of(each: Wanted, config: dict) -> dict:
    """The record of a stored network.

    Raises
    ------
    ValueError
        If it was trained with settings other than those of the configuration, or its file is damaged.
    """
    path = each.kept(config, ".json")
    record = read_results(path)
    # Settings introduced after the record have their defaults.
    try:
        trained = each.system(config).complete(record["config"])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if trained != each.settings(config):
        raise ValueError(f"{path} was trained with other settings than {config['settings']} and the arm: train it anew")
    return record
