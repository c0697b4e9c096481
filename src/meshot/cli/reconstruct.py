"""``meshot reconstruct SCAN -o OUT``, and ``meshot reconstruct BIDS OUT participant`` as BIDS apps have it."""

import argparse
import os
import warnings
from pathlib import Path

from meshot.cli.note import NOTE, Commands, add_command
from meshot.files import printable_name

LEVELS = ("participant", "group")
#: Options that only a BIDS data set has.
_OF_BIDS = ("participant_label", "session_label", "acquisition", "run_number", "derivatives")


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
    command = add_command(
        commands,
        "reconstruct",
        "Find the white surfaces of both hemispheres in a scan, or in all scans of a study.",
        "The command writes the surfaces in scanner coordinates (RAS, mm) as FreeSurfer, GIfTI and PLY files, the "
        f"transform to MNI152, labels of white matter, all numbers, and a report page. {NOTE}",
        """
        meshot reconstruct T1.nii.gz -o OUT
        meshot reconstruct T1.nii.gz -o OUT --brain-mask mask.nii.gz
        meshot reconstruct RAW OUT participant --derivatives MASKS --layout bids --jobs 4
        meshot reconstruct RAW OUT group
        """,
        "The scan should be a T1 of an adult head without its skull, as NIfTI or MGH, in any orientation and "
        "voxel size. A scan with its skull needs a brain mask, made by SynthStrip or HD-BET for example. One file "
        "gives one folder. Several files, a folder of scans, or a BIDS data set give a study: a folder for each "
        "participant and session, and the table subjects.tsv. A second start does what is missing. The level group "
        "only writes the table again. The exit status is 1 if a scan of a study failed.",
        usage="meshot reconstruct SCAN... -o FOLDER [options]\n"
        "       meshot reconstruct BIDS FOLDER {participant,group} [options]",
    )
    command.add_argument(
        "scan", type=Path, nargs="+", help="A T1-weighted scan, several scans, a folder of scans, or a BIDS data set."
    )
    _add_output(command)
    _add_networks(command)
    _add_care(command)
    _add_bids(command.add_argument_group("of a BIDS data set"))
    command.set_defaults(run=_run)


def _add_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FOLDER",
        help="Write the results to this folder, which is new, empty or of the same study.",
    )
    command.add_argument(
        "--layout",
        choices=("flat", "freesurfer", "bids"),
        default="flat",
        help="Arrange results in flat folders, as FreeSurfer's SUBJECTS_DIR or as BIDS derivatives "
        "(default: %(default)s).",
    )
    command.add_argument(
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="Reconstruct this many scans of a study side by side (default: %(default)s).",
    )
    command.add_argument("--overwrite", action="store_true", help="Replace an earlier reconstruction in the folder.")


def _add_care(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--brain-mask", type=Path, metavar="FILE", help="Use this volume, which is 0 outside the brain."
    )
    command.add_argument("--strict", action="store_true", help="Stop with exit status 3 instead of a warning.")
    command.add_argument(
        "--threads",
        type=int,
        metavar="N",
        help="Use this many threads in each process (default: as many as torch chooses; 1 with several jobs).",
    )


def _add_networks(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--system", metavar="NAME", help="Find the surfaces with this system (default: that of the package)."
    )
    command.add_argument(
        "--weights",
        type=Path,
        metavar="FOLDER",
        help="Use the weights of the system in this folder (default: those of the package).",
    )
    command.add_argument(
        "--segmentation",
        type=Path,
        metavar="FILE",
        help="Use the segmentation network of this file (default: that of the package).",
    )
    command.add_argument("--initial-only", action="store_true", help="Stop after the initial surfaces, without a flow.")


def _add_bids(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--participant-label",
        "--participant_label",
        nargs="+",
        default=[],
        metavar="LABEL",
        help="Reconstruct these participants (default: all).",
    )
    group.add_argument(
        "--session-label",
        "--session_label",
        nargs="+",
        default=[],
        metavar="LABEL",
        help="Reconstruct these sessions (default: all).",
    )
    group.add_argument("--acquisition", metavar="LABEL", help="Use only scans with this value of acq.")
    group.add_argument("--run", metavar="NUMBER", dest="run_number", help="Use only scans with this value of run.")
    group.add_argument(
        "--runs",
        choices=("average", "first"),
        default="average",
        help="Register and average several runs, or use the first (default: %(default)s).",
    )
    group.add_argument(
        "--derivatives", type=Path, metavar="FOLDER", help="Take brain masks from this BIDS data set of derivatives."
    )


def _run(chosen: argparse.Namespace) -> int:
    inputs, output, level = _places(chosen)
    if level is None and len(inputs) == 1 and not inputs[0].is_dir() and chosen.layout == "flat":
        _refuse(chosen, "a single scan", _OF_BIDS)
        return _run_one(chosen, inputs[0], output)
    return _run_study(chosen, inputs, output, level)


def _places(chosen: argparse.Namespace) -> tuple[list[Path], Path, str | None]:
    """The inputs, the folder of the results, and the level of a BIDS app."""
    level = str(chosen.scan[-1]) if len(chosen.scan) == 3 and str(chosen.scan[-1]) in LEVELS else None
    if level is not None and chosen.output is None:
        return [chosen.scan[0]], chosen.scan[1], level
    if chosen.output is None:
        raise ValueError(
            "there is no folder for the results; name it: meshot reconstruct SCAN -o FOLDER, or meshot reconstruct "
            "BIDS FOLDER participant"
        )
    return chosen.scan, chosen.output, None


def _refuse(chosen: argparse.Namespace, what: str, options: tuple[str, ...]) -> None:
    words = {"run_number": "run"}
    given = [f"--{words.get(name, name).replace('_', '-')}" for name in options if getattr(chosen, name)]
    if given:
        raise ValueError(f"{given[0]} does not go with {what}; leave it out")


def _run_one(chosen: argparse.Namespace, scan: Path, output: Path) -> int:
    # Here, so that other commands do not wait for what only this one needs.
    import torch

    from meshot.errors import require_positive_integer
    from meshot.pipeline import load_networks
    from meshot.pipeline.report import PAGE, write_reconstruction

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    networks = load_networks(chosen.system, chosen.weights, chosen.segmentation, chosen.initial_only)
    report = write_reconstruction(
        scan, output, networks, chosen.overwrite, brain_mask=chosen.brain_mask, strict=chosen.strict
    )
    for side, surface in report["surfaces"].items():
        final = surface["final"]
        print(
            f"{side}: χ = {final['euler_number']}, {final['n_self_intersecting_faces']} self-intersecting of "
            f"{final['n_faces']} faces, {final['volume_cm3']:.0f} cm³"
        )
    for warning in report["warnings"]:
        warnings.warn(warning, stacklevel=1)
    print(f"{sum(report['seconds']['clock'].values()):.0f} s; look at {printable_name(output / PAGE)}. {NOTE}")
    return 0


def _run_study(chosen: argparse.Namespace, inputs: list[Path], output: Path, level: str | None) -> int:
    if chosen.jobs > 1:  # set before NumPy is imported: one thread per process
        for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
            os.environ.setdefault(variable, "1")
    from meshot.errors import require_positive_integer
    from meshot.pipeline import load_networks
    from meshot.study import TABLE, StudySettings, missing_participants, reconstruct_study, write_table

    if level == "group":
        rows = write_table(output)
        print(f"{len(rows)} visits; the table is {printable_name(output / TABLE)}. {NOTE}")
        return 0
    _refuse(chosen, "a study; masks come from --derivatives", ("brain_mask",))
    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
    names = ("layout", "system", "weights", "segmentation", "initial_only", "strict", "overwrite", "threads")
    settings = StudySettings(**{name: getattr(chosen, name) for name in names})
    load_networks(
        chosen.system, chosen.weights, chosen.segmentation, chosen.initial_only
    )  # fails before the first scan
    dataset, visits = _visits(chosen, inputs, level)
    for name in [] if dataset is None else missing_participants(dataset):
        warnings.warn(f"{name} is in participants.tsv, but has no folder", stacklevel=1)
    failed = reconstruct_study(visits, output, settings, chosen.jobs, dataset)
    done = len(visits) - len(failed)
    print(f"{done} done, {len(failed)} failed; the table is {printable_name(output / TABLE)}. {NOTE}")
    return int(bool(failed))


def _visits(chosen: argparse.Namespace, inputs: list[Path], level: str | None) -> tuple[Path | None, list]:
    """The data set, if there is one, and its visits."""
    from meshot.study import DESCRIPTION, Choice, visits_of_bids, visits_of_files, visits_of_folder

    bids = level is not None or (len(inputs) == 1 and (inputs[0] / DESCRIPTION).is_file())
    if bids:
        choice = Choice(
            tuple(chosen.participant_label), tuple(chosen.session_label), chosen.acquisition, chosen.run_number,
            chosen.runs, chosen.derivatives,
        )  # fmt: skip
        return inputs[0], visits_of_bids(inputs[0], choice)
    _refuse(chosen, "scans that are no BIDS data set", _OF_BIDS)
    if len(inputs) == 1 and inputs[0].is_dir():
        return None, visits_of_folder(inputs[0])
    missing = [path for path in inputs if not path.is_file()]
    if missing:
        raise ValueError(f"{missing[0]} does not exist or is no file; name scans, one folder, or one BIDS data set")
    return None, visits_of_files(inputs)
