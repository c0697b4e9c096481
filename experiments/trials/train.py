"""Train what is missing of a protocol: trials of rates, then every system, in this process or side by side.

``train.py`` in the folder of an experiment calls it.
"""

import argparse
import contextlib
import json
import os
import shutil
import signal
import sys
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.files import whole_file, whole_folder
from meshot.model import DeformationNetwork, halve_weights, read_weights, write_weights
from meshot.pipeline import (
    LOG,
    RECORD,
    STATE_FOLDER,
    WEIGHTS,
    InitialSurfaces,
    run_system_training,
    segmentation_weights,
)
from meshot.synth import scans
from meshot.train import TrainingLog, TrainingState, read_log
from meshot_book.trainings import OUTPUT, alone, require_device, thinned, train_in_processes, train_in_turn
from trials.rates import SCORE, changes_of, choose, known_rates, needed_rates, score_of
from trials.training import LAST, Training, arguments, chosen, finals, read_config, segmentation_network, trials

#: The exit status of a run that was stopped by ``--minutes``.
STOPPED = os.EX_TEMPFAIL


def train_one(training: Training, config: dict, device: str = "cpu") -> None:
    """Train one system on one thread, and keep its weights, records and logs. A trial also gets its score.

    A trial whose loss is not finite is kept without one.
    """
    torch.set_num_threads(1)
    changes = training.changes(config, changes_of(training, config))
    with alone(training.state(config)):
        if training.is_made(config):  # by another process, in the meantime
            return
        try:
            run_system_training(
                training.system, config["settings"], [config["cohorts"][training.cohort]], training.state(config),
                segmentation_weights(config["segmentation"]), config["initial"], changes, torch.device(device),
            )  # fmt: skip
        except FloatingPointError as error:
            if not training.is_trial:
                raise
            with whole_folder(training.kept(config)) as place:
                _write(place / SCORE, {"assd_mm": None, "why": str(error), "changes": changes})
            return
        keep(training, config, device)


def keep(training: Training, config: dict, device: str = "cpu") -> None:
    """Copy the files of all networks to their final place.

    A folder appears when it is complete; without one, the record is last and marks completion. Weights at equal seconds
    and of further seeds are kept as float16. With ``keep_last`` in the protocol, the last weights are kept beside the
    best ones.
    """
    state, in_folder = training.state(config), training.budget is not None
    whole = whole_folder(training.kept(config)) if in_folder else contextlib.nullcontext(Path(config["weights"]))
    copy = halve_weights if in_folder and not (training.is_trial or training.is_first) else shutil.copyfile
    with whole as place:
        for part in training.parts(config):
            name = part if in_folder else training.name
            if config.get("keep_last"):
                network, record = read_weights(state / f"{part}{WEIGHTS}", DeformationNetwork)
                network.load_state_dict(TrainingState.read_last_weights(state / STATE_FOLDER / part))
                write_weights(place / f"{name}{LAST}", network, record)
            TrainingLog(place / f"{name}{LOG}", thinned(read_log(state / f"{part}{LOG}")))
            for end, write in ((WEIGHTS, copy), (RECORD, shutil.copyfile)):
                with whole_file(place / f"{name}{end}") as temporary:
                    write(state / f"{part}{end}", temporary)
        if training.is_trial:
            _write(place / SCORE, score_of(place, training, config, torch.device(device)))


def _write(path: Path, content: dict) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def write_initial_surfaces(trainings: list[Training], config: dict) -> None:
    """Compute the missing initial surfaces, so that parallel trainings do not compute the same ones."""
    torch.set_num_threads(1)
    surfaces = InitialSurfaces(config["initial"], segmentation_network(config))
    subjects = [
        subject
        for cohort in dict.fromkeys(each.cohort for each in trainings if each.kind().needs)
        for split in ("train", "validation")
        for subject in scans(config["cohorts"][cohort], split)
    ]
    for subject in tqdm(subjects, desc="initial surfaces"):
        surfaces.of(subject, "left")  # makes both sides


def train_missing(trainings: list[Training], config: dict, asked: argparse.Namespace, script: str) -> list[str]:
    """Train what is missing, in turn or side by side. Returns the names of those that failed."""
    missing = {each.name: each for each in trainings if not each.is_made(config)}
    if asked.jobs == 1 or len(missing) < 2:
        return train_in_turn(list(missing), lambda name: train_one(missing[name], config, asked.device))
    write_initial_surfaces(list(missing.values()), config)
    words = ["--config", str(asked.config), "--device", asked.device]
    folders = {name: each.state(config) for name, each in missing.items()}
    return train_in_processes(folders, [sys.executable, script, *words], asked.jobs)


def run_trainings(about: str, script: str, words: list[str] | None = None) -> int:
    """Train the trials, choose rates, and train the rest. Returns 1 if something failed or waits.

    A training waits if it needs a rate whose trials are not all there. ``about`` is what ``--help`` says. ``script`` is
    the ``train.py`` of an experiment, which stands beside its protocol.
    """
    parser = arguments(about, Path(script).parent)
    parser.add_argument("--only", nargs="+", default=["*"], metavar="PATTERN", help="names, * for anything")
    parser.add_argument("--jobs", type=int, default=1, help="number of parallel trainings (default: %(default)s)")
    parser.add_argument("--device", default="cpu", help="such as cuda (default: %(default)s)")
    parser.add_argument("--minutes", type=float, help="stop after so many minutes; the same command goes on")
    parser.add_argument("--list", action="store_true", help="show which trainings exist, and train nothing")
    asked = parser.parse_args(words)
    require_device(asked.device)
    config = read_config(asked.config)
    trainings, rates = chosen([*trials(config), *finals(config)], asked.only), known_rates(config)
    if asked.list:
        for each in trainings:
            # The trials of a rate that is chosen are not needed any more.
            missing = "chosen" if each.is_trial and each.arm in rates else "missing"
            print(f"{'there' if each.is_made(config) else missing:8} {each.name}")
        return 0
    # On SIGTERM, exit normally, so that child processes are stopped too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if asked.minutes is not None:
        signal.signal(signal.SIGALRM, lambda *_: sys.exit(STOPPED))
        signal.setitimer(signal.ITIMER_REAL, 60 * asked.minutes)
    try:
        tried = [each for each in trainings if each.is_trial and each.arm not in rates]
        failed, without = train_missing(tried, config, asked, script), set()
        arms = {each.arm for each in trainings}.union(*(needed_rates(each, config) for each in trainings))
        for arm in filter(arms.__contains__, config["arms"]):
            try:
                rates = choose(config, arm)
            except ValueError as error:
                print(error, file=sys.stderr)
                without.add(arm)
        known, others = rates.keys() - without, [each for each in trainings if not each.is_trial]
        ready = [each for each in others if needed_rates(each, config) <= known]
        failed += [*sorted(without), *train_missing(ready, config, asked, script)]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    if waiting := [each.name for each in others if each not in ready]:
        print(f"waiting for trials of rates: {', '.join(waiting)}", file=sys.stderr)
    if failed:
        where = f"; {config['state']}/NAME/{OUTPUT} may say why" if asked.jobs > 1 else ""
        print(f"failed: {', '.join(failed)}{where}", file=sys.stderr)
    return int(bool(failed or waiting))
