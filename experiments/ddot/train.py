"""Train the missing networks of the experiment, starting with those for the fair pairs.

Run as ``python experiments/ddot/train.py`` when both cohorts and the segmentation weights exist. ``--jobs 2`` trains
two networks at a time, each on one thread; ``--only 'oasis_like_left_*_0'`` selects networks; ``--list`` shows their
status. A stopped training resumes and ends with the same weights.
"""

import argparse
import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import torch
from tqdm import tqdm
from trainings import Wanted, arguments, keep, read_config, segmentation_network, wanted

from meshot.pipeline import STATE_FOLDER, InitialSurfaces, run_system_training, segmentation_weights
from meshot.synth.cohorts import scans

SECONDS_BETWEEN_LOOKS = 5.0
OUTPUT = "output.txt"


class Busy(Exception):
    """Another process is training the same network."""


def made(each: Wanted, config: dict) -> None:
    """Train one network on one thread and store its results.

    Raises
    ------
    Busy
        If another process is training it.
    """
    torch.set_num_threads(1)
    with alone(each.state(config)):
        run_system_training(
            each.system(config).name, config["settings"], [config["cohorts"][each.cohort]], each.state(config),
            segmentation_weights(config["segmentation"]), config["initial"], each.changes(config), torch.device("cpu"),
        )  # fmt: skip
        keep(each, config)


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Lock the folder of a training against other processes. The lock is released when the process ends."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise Busy(f"{folder.name} is being trained by another process") from error
        yield


def prepared(missing: list[Wanted], config: dict) -> None:
    """Compute the missing initial surfaces, so that parallel trainings do not compute the same ones."""
    torch.set_num_threads(1)
    surfaces = InitialSurfaces(config["initial"], segmentation_network(config))
    cohorts = dict.fromkeys((each.cohort, each.side) for each in missing)
    found = [
        (subject, side)
        for cohort, side in cohorts
        for split in ("train", "validation")
        for subject in scans(config["cohorts"][cohort], split)
    ]
    for subject, side in tqdm(found, desc="initial surfaces"):
        surfaces.of(subject, side)


def side_by_side(missing: list[Wanted], config: dict, words: list[str], n_jobs: int) -> list[str]:
    """Train in ``n_jobs`` processes, with output in ``output.txt`` beside the state. Returns names of failures."""
    waiting, running, failed = list(missing), {}, []
    with tqdm(total=len(missing), desc="trainings", unit="network") as bar:
        try:
            while waiting or running:
                while waiting and len(running) < n_jobs:
                    each = waiting.pop(0)
                    running[each] = _started(each, config, words)
                time.sleep(SECONDS_BETWEEN_LOOKS)
                for each in [each for each, process in running.items() if process.poll() is not None]:
                    failed += [each.name] if running.pop(each).returncode else []
                    bar.update()
                bar.set_postfix_str("; ".join(f"{each.name}: step {_steps(each, config)}" for each in running))
        finally:
            for process in running.values():
                process.terminate()
    return failed


def _started(each: Wanted, config: dict, words: list[str]) -> subprocess.Popen:
    each.state(config).mkdir(parents=True, exist_ok=True)
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    with (each.state(config) / OUTPUT).open("a") as output:
        return subprocess.Popen(
            [sys.executable, __file__, *words, "--only", each.name],
            stdout=output, stderr=output, env=os.environ | one_thread,
        )  # fmt: skip


def _steps(each: Wanted, config: dict) -> int:
    """The approximate number of steps done: the number of lines in the log, of which a few are validations."""
    path = each.state(config) / STATE_FOLDER / each.part / "log.jsonl"
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def in_turn(missing: list[Wanted], config: dict) -> list[str]:
    """Train one network after another in this process. Returns names of failures."""
    failed = []
    for i, each in enumerate(missing):
        print(f"{each.name} ({i + 1} of {len(missing)})", file=sys.stderr)
        try:
            made(each, config)
        except (Busy, FloatingPointError, ValueError) as error:
            print(error, file=sys.stderr)
            failed.append(each.name)
    return failed


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line."""
    parser = arguments(__doc__)
    parser.add_argument("--only", nargs="+", default=["*"], metavar="PATTERN", help="names, * for anything")
    parser.add_argument("--jobs", type=int, default=1, help="number of parallel trainings (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="show which networks exist, and train nothing")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Train the missing networks. Returns 1 if one failed."""
    asked = parsed(words)
    config = read_config(asked.config)
    chosen = wanted(config, asked.only)
    missing = [each for each in chosen if not each.is_made(config)]
    if asked.list:
        print("\n".join(f"{'missing' if each in missing else 'there':8} {each.name}" for each in chosen))
        return 0
    # On SIGTERM, exit normally, so that child processes are stopped too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if asked.jobs > 1 and len(missing) > 1:
        prepared(missing, config)
        failed = side_by_side(missing, config, ["--config", str(asked.config)], asked.jobs)
        where = f"; {Path(config['state'])}/NAME/{OUTPUT} says why"
    else:
        failed, where = in_turn(missing, config), ""
    if failed:
        print(f"failed: {', '.join(failed)}{where}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
