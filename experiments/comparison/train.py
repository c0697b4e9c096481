"""Train what is missing: trials of rates, then every system with its own rate, first at equal steps.

Run as ``python experiments/comparison/train.py`` when both cohorts and the segmentation weights exist. A stopped
training resumes, and on one CPU thread ends with the same weights. Options::

    --list                 show which trainings exist, and train nothing
    --only 'oasis_*ddot*'  train only those
    --jobs 2               train two at a time, each on one thread
    --device cuda          train on an accelerator
    --minutes 9            stop after so many minutes with status 75; the same command goes on
"""

import argparse
import json
import os
import shutil
import signal
import sys
from pathlib import Path

import torch
from budgets import SCORE, changes_of, choose, known_rates, needed_rates, score_of
from tqdm import tqdm
from units import Unit, arguments, chosen, finals, read_config, segmentation_network, trials

from meshot.files import whole_folder
from meshot.model import halve_weights
from meshot.pipeline import LOG, RECORD, WEIGHTS, InitialSurfaces, run_system_training, segmentation_weights
from meshot.synth import scans
from meshot.train import TrainingLog, read_log
from meshot_book.trainings import OUTPUT, alone, require_device, thinned, train_in_processes, train_in_turn

#: The exit status of a run that was stopped by ``--minutes``.
STOPPED = os.EX_TEMPFAIL


def made(unit: Unit, config: dict, device: torch.device | None = None) -> None:
    """Train one system on one thread, and keep its weights, records and logs. A trial also gets its score.

    Raises
    ------
    Busy
        If another process is training it.
    FloatingPointError
        If a loss is not finite. A trial is then kept without a score.
    ValueError
        If it needs a rate that is not chosen.
    """
    torch.set_num_threads(1)
    changes = unit.all_changes(config, changes_of(unit, config))
    with alone(unit.state(config)):
        if unit.is_made(config):  # by another process, in the meantime
            return
        try:
            run_system_training(
                unit.system, config["settings"], [config["cohorts"][unit.cohort]], unit.state(config),
                segmentation_weights(config["segmentation"]), config["initial"], changes, device,
            )  # fmt: skip
        except FloatingPointError as error:
            if not unit.is_trial:
                raise
            with whole_folder(unit.kept(config)) as place:
                _write(place / SCORE, {"assd_mm": None, "why": str(error), "changes": changes})
            return
        keep(unit, config, device)


def keep(unit: Unit, config: dict, device: torch.device | None = None) -> None:
    """Copy the files of all networks to their final folder, which appears when it is complete.

    Weights at equal seconds and of further seeds are kept as float16.
    """
    state = unit.state(config)
    with whole_folder(unit.kept(config)) as place:
        for part in unit.parts(config):
            TrainingLog(place / f"{part}{LOG}", thinned(read_log(state / f"{part}{LOG}")))
            copy = shutil.copyfile if unit.is_trial or unit.is_first else halve_weights
            copy(state / f"{part}{WEIGHTS}", place / f"{part}{WEIGHTS}")
            shutil.copyfile(state / f"{part}{RECORD}", place / f"{part}{RECORD}")
        if unit.is_trial:
            _write(place / SCORE, score_of(place, unit, config, device))


def _write(path: Path, content: dict) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def prepared(units: list[Unit], config: dict) -> None:
    """Compute the missing initial surfaces, so that parallel trainings do not compute the same ones."""
    torch.set_num_threads(1)
    surfaces = InitialSurfaces(config["initial"], segmentation_network(config))
    cohorts = dict.fromkeys(unit.cohort for unit in units if unit.kind().needs)
    subjects = [
        subject
        for cohort in cohorts
        for split in ("train", "validation")
        for subject in scans(config["cohorts"][cohort], split)
    ]
    for subject in tqdm(subjects, desc="initial surfaces"):
        surfaces.of(subject, "left")  # makes both sides


def trained(units: list[Unit], config: dict, asked: argparse.Namespace) -> list[str]:
    """Train what is missing, in turn or side by side. Returns the names of those that failed."""
    missing = {unit.name: unit for unit in units if not unit.is_made(config)}
    device = torch.device(asked.device)
    if asked.jobs == 1 or len(missing) < 2:
        return train_in_turn(list(missing), lambda name: made(missing[name], config, device))
    prepared(list(missing.values()), config)
    words = ["--config", str(asked.config), "--device", asked.device]
    folders = {name: unit.state(config) for name, unit in missing.items()}
    return train_in_processes(folders, [sys.executable, __file__, *words], asked.jobs)


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line."""
    parser = arguments(__doc__)
    parser.add_argument("--only", nargs="+", default=["*"], metavar="PATTERN", help="names, * for anything")
    parser.add_argument("--jobs", type=int, default=1, help="number of parallel trainings (default: %(default)s)")
    parser.add_argument("--device", default="cpu", help="such as cuda (default: %(default)s)")
    parser.add_argument("--minutes", type=float, help="stop after so many minutes; the same command goes on")
    parser.add_argument("--list", action="store_true", help="show which trainings exist, and train nothing")
    return parser.parse_args(words)


def listed(units: list[Unit], config: dict) -> str:
    """A line for every training: whether it is there. The trials of a rate that is chosen are not needed any more."""
    rates = known_rates(config)

    def status(unit: Unit) -> str:
        if unit.is_made(config):
            return "there"
        return "chosen" if unit.is_trial and unit.arm in rates else "missing"

    return "\n".join(f"{status(unit):8} {unit.name}" for unit in units)


def stopping_after(minutes: float | None) -> None:
    """Exit with status 75 after some minutes, and on SIGTERM normally, so that child processes are stopped too."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if minutes is not None:
        signal.signal(signal.SIGALRM, lambda *_: sys.exit(STOPPED))
        signal.setitimer(signal.ITIMER_REAL, 60 * minutes)


def main(words: list[str] | None = None) -> int:
    """Train what is missing. Returns 1 if something failed or waits.

    Raises
    ------
    ValueError
        If the device is not there, or no training has a name that was asked for.
    """
    asked = parsed(words)
    require_device(asked.device)
    config = read_config(asked.config)
    units = chosen([*trials(config), *finals(config)], asked.only)
    if asked.list:
        print(listed(units, config))
        return 0
    stopping_after(asked.minutes)
    try:
        failed, waiting = train_all(units, config, asked)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    if waiting:
        print(f"waiting for trials of rates: {', '.join(waiting)}", file=sys.stderr)
    if failed:
        print(f"failed: {', '.join(failed)}; {config['state']}/NAME/{OUTPUT} may say why", file=sys.stderr)
    return int(bool(failed or waiting))


def train_all(units: list[Unit], config: dict, asked: argparse.Namespace) -> tuple[list[str], list[str]]:
    """Train the trials, choose rates, and train the rest. Returns the names of what failed, and of what waits.

    A training waits if it needs a rate whose trials are not all there.
    """
    rates, without = known_rates(config), set()
    failed = trained([unit for unit in units if unit.is_trial and unit.arm not in rates], config, asked)
    arms = {unit.arm for unit in units}.union(*(needed_rates(unit, config) for unit in units))
    for arm in filter(arms.__contains__, config["arms"]):
        try:
            rates = choose(config, arm)
        except ValueError as error:
            print(error, file=sys.stderr)
            without.add(arm)
    failed += sorted(without)
    known = rates.keys() - without
    ready = [unit for unit in units if not unit.is_trial and needed_rates(unit, config) <= known]
    waiting = [unit.name for unit in units if not unit.is_trial and unit not in ready]
    failed += trained(ready, config, asked)
    return failed, waiting


if __name__ == "__main__":
    sys.exit(main())
