"""Train the missing networks of the experiment, starting with those for the fair pairs.

Run as ``python experiments/ddot/train.py`` when both cohorts and the segmentation weights exist. ``--jobs 2`` trains
two networks at a time, each on one thread; ``--only 'oasis_like_left_*_0'`` selects networks; ``--list`` shows their
status; ``--device cuda`` trains on an accelerator. A stopped training resumes, and on a CPU ends with the same weights.
"""

import argparse
import signal
import sys
from pathlib import Path

import torch
from tqdm import tqdm
from trainings import Wanted, arguments, keep, read_config, segmentation_network, wanted

from meshot.pipeline import InitialSurfaces, run_system_training, segmentation_weights
from meshot.synth import scans
from meshot_book.trainings import OUTPUT, alone, require_device, train_in_processes, train_in_turn


def made(each: Wanted, config: dict, device: str = "cpu") -> None:
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
            segmentation_weights(config["segmentation"]), config["initial"], each.changes(config), torch.device(device),
        )  # fmt: skip
        keep(each, config)


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


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line."""
    parser = arguments(__doc__)
    parser.add_argument("--only", nargs="+", default=["*"], metavar="PATTERN", help="names, * for anything")
    parser.add_argument("--jobs", type=int, default=1, help="number of parallel trainings (default: %(default)s)")
    parser.add_argument("--device", default="cpu", help="such as cuda (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="show which networks exist, and train nothing")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Train the missing networks. Returns 1 if one failed.

    Raises
    ------
    ValueError
        If the device is not there, or no network has a name that was asked for.
    """
    asked = parsed(words)
    require_device(asked.device)
    config = read_config(asked.config)
    chosen = wanted(config, asked.only)
    missing = [each for each in chosen if not each.is_made(config)]
    if asked.list:
        print("\n".join(f"{'missing' if each in missing else 'there':8} {each.name}" for each in chosen))
        return 0
    # On SIGTERM, exit normally, so that child processes are stopped too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    by_name = {each.name: each for each in missing}
    if asked.jobs > 1 and len(missing) > 1:
        prepared(missing, config)
        folders = {name: each.state(config) for name, each in by_name.items()}
        words = ["--config", str(asked.config), "--device", asked.device]
        failed = train_in_processes(folders, [sys.executable, __file__, *words], asked.jobs)
        where = f"; {Path(config['state'])}/NAME/{OUTPUT} says why"
    else:
        failed, where = train_in_turn(list(by_name), lambda name: made(by_name[name], config, asked.device)), ""
    if failed:
        print(f"failed: {', '.join(failed)}{where}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
