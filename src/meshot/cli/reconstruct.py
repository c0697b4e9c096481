"""``meshot reconstruct SCAN -o OUT``, and ``meshot reconstruct BIDS OUT participant`` as BIDS apps have it."""

import argparse
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from meshot.cli.common import COUNT, FILE, FOLDER, NOTE, Commands, add_command, device_errors, device_of, known_systems
from meshot.files import printable_name

if TYPE_CHECKING:  # for annotations only: importing torch would delay --help
    from meshot.pipeline import TrainedNetworks

LEVELS = ("participant", "group")
#: Options that only a BIDS data set has.
_OF_BIDS = ("participant_label", "session_label", "acquisition", "run_number", "filter", "derivatives")


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
    command = add_command(
        commands,
        "reconstruct",
        "Find the white and pial surfaces of both hemispheres in a scan, or in all scans of a study.",
        "The command writes the surfaces in scanner "
        "coordinates (RAS, mm) as FreeSurfer, GIfTI and PLY files, the "
        f"transform to MNI152, labels of white matter, all numbers, and a report page. {NOTE}",
        """
        meshot reconstruct T1.nii.gz -o OUT
        meshot reconstruct T1.nii.gz -o OUT --brain-mask mask.nii.gz
        meshot reconstruct RAW OUT participant --derivatives MASKS --layout bids --jobs 4
        meshot reconstruct RAW OUT group
        """,
        "The scan should be a T1 of an adult head, as NIfTI or MGH, in any orientation and voxel size. The networks "
        "have seen synthetic skulls only: a scan with its skull is best given with a brain mask, made by SynthStrip or "
        "HD-BET for example. One file gives one folder. "
        "Several files, a folder of scans, or a BIDS data set give a study: a folder for each "
        "participant and session, and the table subjects.tsv. A second start does what is missing. The level group "
        "only writes the table again. The file logs/meshot.log in the folder has a line for each visit of a study. The "
        "exit status is 0 if everything is done, 1 if a scan of a study failed and the others are done, 2 if the input "
        "will not do, and 3 if --strict stopped a single scan.",
        usage="meshot reconstruct SCAN... -o FOLDER [options]\n"
        "       meshot reconstruct BIDS FOLDER {participant,group} [options]",
    )
    command.add_argument(
        "scan", type=Path, nargs="+", help="A T1-weighted scan, several scans, a folder of scans, or a BIDS data set."
    )
    command.add_argument(
        "-o", "--output", **FOLDER, help="Write the results to this folder, which is new, empty or of the same study."
    )
    command.add_argument(
        "--layout",
        choices=("flat", "freesurfer", "bids"),
        default="flat",
        help="Arrange results in flat folders, as FreeSurfer's SUBJECTS_DIR or as BIDS derivatives "
        "(default: %(default)s).",
    )
    command.add_argument(
        "--jobs", **COUNT, default=1, help="Reconstruct this many scans of a study side by side (default: %(default)s)."
    )
    command.add_argument("--overwrite", action="store_true", help="Replace an earlier reconstruction in the folder.")
    command.add_argument(
        "--system",
        metavar="NAME",
        help=f"Find the surfaces with this system (default: that of the package): {', '.join(known_systems())}.",
    )
    command.add_argument(
        "--weights", **FOLDER, help="Use the weights of the system in this folder (default: those of the package)."
    )
    command.add_argument(
        "--segmentation", **FILE, help="Use the segmentation network of this file (default: that of the package)."
    )
    command.add_argument(
        "--white-only", action="store_true", help="Find no pial surfaces, and so no thickness; half a minute less."
    )
    command.add_argument("--initial-only", action="store_true", help="Stop after the initial surfaces, without a flow.")
    command.add_argument(
        "--device", help="Compute the networks on this device: cpu, cuda or cuda:1, for example (default: cpu)."
    )
    command.add_argument(
        "--template",
        action="store_true",
        help="Also carry fsaverage5's white surface to each side, so that vertices correspond between people, and "
        "write area, curvature, thickness and volume by region of the cortex; one to two minutes more.",
    )
    command.add_argument("--brain-mask", **FILE, help="Use this volume, which is 0 outside the brain.")
    command.add_argument("--strict", action="store_true", help="Stop with exit status 3 instead of a warning.")
    command.add_argument(
        "--threads",
        **COUNT,
        help="Use this many threads in each process (default: as many as torch chooses; 1 with several jobs).",
    )
    words = command.add_mutually_exclusive_group()
    words.add_argument("--verbose", action="store_true", help="Also print how long each stage of a scan took.")
    words.add_argument("--quiet", action="store_true", help="Print warnings and errors only, and no progress bar.")
    group = command.add_argument_group("of a BIDS data set")
    for one in ("participant", "session"):
        names, what = (f"--{one}-label", f"--{one}_label"), f"Reconstruct these {one}s (default: all)."
        group.add_argument(*names, nargs="+", default=[], metavar="LABEL", help=what)
    group.add_argument("--acquisition", metavar="LABEL", help="Use only scans with this value of acq.")
    group.add_argument("--run", metavar="NUMBER", dest="run_number", help="Use only scans with this value of run.")
    group.add_argument(
        "--filter",
        nargs="+",
        default=[],
        metavar="KEY-VALUE",
        help="Use only scans with these entities, such as rec-norm; without a value, as in rec-, those that have none.",
    )
    group.add_argument(
        "--runs",
        choices=("average", "first"),
        default="average",
        help="Register and average several runs, or use the first (default: %(default)s).",
    )
    group.add_argument("--derivatives", **FOLDER, help="Take brain masks from this BIDS data set of derivatives.")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> int:
    # The inputs, the folder of the results, and the level of a BIDS app.
    inputs, output, level = chosen.scan, chosen.output, None
    if output is None and len(inputs) == 3 and str(inputs[-1]) in LEVELS:
        inputs, output, level = inputs[:1], inputs[1], str(inputs[2])
    if output is None:
        raise ValueError(
            "there is no folder for the results; name it: meshot reconstruct SCAN -o FOLDER, or meshot reconstruct "
            "BIDS FOLDER participant"
        )
    if level is None and len(inputs) == 1 and not inputs[0].is_dir() and chosen.layout == "flat":
        _refuse(chosen, "a single scan", _OF_BIDS)
        return _run_one(chosen, inputs[0], output)
    return _run_study(chosen, inputs, output, level)


def _refuse(chosen: argparse.Namespace, what: str, options: tuple[str, ...]) -> None:
    words = {"run_number": "run"}
    given = [f"--{words.get(name, name).replace('_', '-')}" for name in options if getattr(chosen, name)]
    if given:
        raise ValueError(f"{given[0]} does not go with {what}; leave it out")


def _run_one(chosen: argparse.Namespace, scan: Path, output: Path) -> int:
    # Here, so that other commands do not wait for what only this one needs.
    import torch

    from meshot.errors import require_positive_integer
    from meshot.pipeline import PAGE, doubts_in_words, seconds_by_stage, write_reconstruction

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    with device_errors():
        care = {"brain_mask": chosen.brain_mask, "strict": chosen.strict, "quiet": chosen.quiet}
        care["correspondence"] = chosen.template
        report = write_reconstruction(scan, output, _networks(chosen), chosen.overwrite, **care)
    for warning in report["warnings"]:
        warnings.warn(warning, stacklevel=1)
    if chosen.quiet:
        return 0
    if chosen.verbose:
        print(seconds_by_stage(report["seconds"]["clock"]))
    for side, surface in report["surfaces"].items():
        final = surface["final"]
        print(
            f"{side}: χ = {final['euler_number']}, {final['n_self_intersecting_faces']} self-intersecting of "
            f"{final['n_faces']} faces, {final['volume_cm3']:.0f} cm³"
        )
        if surface["pial"]:
            pial = surface["pial"]
            print(
                f"{side}, pial: χ = {pial['euler_number']}, {pial['n_self_intersecting_faces']} self-intersecting of "
                f"{pial['n_faces']} faces, {pial['distance_from_white_mm']['mean']:.1f} mm from the white surface"
            )
        if surface["fsaverage5"]:
            print(f"{side}: fsaverage5 carried to it lies {surface['fsaverage5']['distance_mm']:.2f} mm away (ASSD)")
    if report["doubts"]:
        print(f"unusual, look there first: {doubts_in_words(report['doubts'])}")
    print(f"{sum(report['seconds']['clock'].values()):.0f} s; look at {printable_name(output / PAGE)}. {NOTE}")
    return 0


def _run_study(chosen: argparse.Namespace, inputs: list[Path], output: Path, level: str | None) -> int:
    if chosen.jobs > 1:  # set before NumPy is imported: one thread per process
        for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
            os.environ.setdefault(variable, "1")
    from meshot.errors import require_positive_integer
    from meshot.study import TABLE, StudySettings, reconstruct_study, write_table

    if level == "group":
        rows = write_table(output)
        _say(chosen, f"{len(rows)} visits; the table is {printable_name(output / TABLE)}. {NOTE}")
        return 0
    _refuse(chosen, "a study; masks come from --derivatives", ("brain_mask",))
    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
    names = ("layout", "system", "weights", "segmentation", "initial_only", "strict", "overwrite", "threads", "device")
    names += ("white_only",)
    settings = StudySettings(**{name: getattr(chosen, name) for name in names}, correspondence=chosen.template)
    with device_errors():
        _networks(chosen)  # fails before the first scan
    dataset, visits = _visits(chosen, inputs, level)
    tell = {"tell": None} if chosen.quiet else {}
    failed = reconstruct_study(visits, output, settings, chosen.jobs, dataset, detail=chosen.verbose, **tell)
    for visit in failed if chosen.quiet else []:
        warnings.warn(f"{visit.label} failed; the reason is in {printable_name(output / TABLE)}", stacklevel=1)
    done = len(visits) - len(failed)
    _say(chosen, f"{done} done, {len(failed)} failed; the table is {printable_name(output / TABLE)}. {NOTE}")
    return int(bool(failed))


def _say(chosen: argparse.Namespace, text: str) -> None:
    if not chosen.quiet:
        print(text)


def _networks(chosen: argparse.Namespace) -> "TrainedNetworks":
    from meshot.pipeline import load_networks

    device_of(chosen)  # fails if it cannot compute
    names = (chosen.system, chosen.weights, chosen.segmentation)
    return load_networks(*names, chosen.initial_only, chosen.device, chosen.white_only)


def _visits(chosen: argparse.Namespace, inputs: list[Path], level: str | None) -> tuple[Path | None, list]:
    """The data set, if there is one, and its visits."""
    from meshot.study import DESCRIPTION, visits_of_files, visits_of_folder

    bids = level is not None or (len(inputs) == 1 and (inputs[0] / DESCRIPTION).is_file())
    if bids:  # only here is the extra bids needed
        from meshot.study import Choice, missing_participants, visits_of_bids

        labels = tuple(chosen.participant_label), tuple(chosen.session_label)
        runs = chosen.acquisition, chosen.run_number, chosen.runs
        pairs = [each.partition("-") for each in chosen.filter]
        wrong = [key for key, hyphen, _ in pairs if not hyphen]
        if wrong:
            raise ValueError(f"--filter has {wrong[0]!r}; an entity and its value are needed, such as rec-norm or rec-")
        entities = tuple((key, value) for key, _, value in pairs)
        visits = visits_of_bids(inputs[0], Choice(*labels, *runs, chosen.derivatives, entities))
        for name in missing_participants(inputs[0]):
            warnings.warn(f"{name} is in participants.tsv, but has no folder", stacklevel=1)
        return inputs[0], visits
    _refuse(chosen, "scans that are no BIDS data set", _OF_BIDS)
    if len(inputs) == 1 and inputs[0].is_dir():
        return None, visits_of_folder(inputs[0])
    missing = [path for path in inputs if not path.is_file()]
    if missing:
        raise ValueError(f"{missing[0]} does not exist or is no file; name scans, one folder, or one BIDS data set")
    return None, visits_of_files(inputs)
