"""What writes for long or many files, on small inputs and one thread. Single files are written by ``whole_file`` alone.

What is slow to load and not needed by the sample is imported where it is used.
"""

import functools
import sys
from pathlib import Path

import torch
from kill_trials import Writer

from meshot.cli import main as meshot
from meshot.files import whole_file
from meshot.flow import FitSettings, fit_flow, grid_around, sliced_loss, write_velocity
from meshot.loss import random_directions, sliced_wasserstein
from meshot.measure import varifold
from meshot.mesh import ellipsoid, icosphere, write_mesh
from meshot.provenance import write_results
from meshot.synth import read_recipe
from meshot.synth.recipe import recipe_text
from meshot.volume import Volume, write_volume

sys.path.append(str(Path(__file__).resolve().parents[2] / "experiments"))
import experiment

ONE = ["--threads", "1"]
ROOT = Path(__file__).resolve().parents[2]
SCAN = ROOT / "data_synth/sample/sub-001/anat/sub-001_T1w.nii.gz"


def write_experiment(folder: Path, inputs: Path) -> None:
    """Tasks one after the other, and their results."""
    folder.mkdir(exist_ok=True)
    partial, config = folder / "partial.jsonl", {"n": 3}
    rows = experiment.run_jobs(
        range(8), lambda k: torch.rand(20_000, generator=torch.Generator().manual_seed(k)).tolist(), partial, "a", "b"
    )
    write_results(folder / "results.json", {"rows": [row["found"] for row in rows]}, config, "a", "b", 0.0)
    partial.unlink(missing_ok=True)


def write_fit(folder: Path, inputs: Path) -> None:
    """A flow that is fitted, its state, and the field in the end."""
    folder.mkdir(exist_ok=True)
    source, target = icosphere(1, 10.0), ellipsoid(1, (11.0, 9.0, 10.0))
    field = grid_around(source.vertices, target.vertices, margin=4.0, spacings=(8.0,), n_pieces=1)
    settings = FitSettings(n_iterations=8, n_steps=2, n_directions=(4, 4), check_every=4, save_every=2)
    loss = sliced_loss(target, functools.partial(varifold, normal_scale=2.0))
    fit = fit_flow(field, source, loss, settings, folder / "training.safetensors")
    write_velocity(folder / "velocity.safetensors.gz", fit.field)


def write_files(folder: Path, inputs: Path) -> None:
    """Meshes and a scan."""
    mesh = icosphere(4)
    for name in ("a.ply", "a.off", "a.gii", "lh.white"):
        write_mesh(folder / name, mesh)
    random = torch.rand(30, 30, 30, generator=torch.Generator().manual_seed(0))
    write_volume(folder / "a.nii.gz", Volume(random.numpy(), torch.eye(4).double().numpy()))


def make_cohort(folder: Path, inputs: Path) -> int:
    """Two subjects in two processes."""
    return meshot(["make-cohort", "tiny", str(folder), "--jobs", "2", "--subjects", "1"])


def make_inputs(inputs: Path) -> int:
    """A cohort to train on: one subject for training, one for validation."""
    split = {"train": 0.5, "validation": 0.5}
    recipe = read_recipe("tiny", split=split, procedural_subjects=0)
    file = inputs.with_suffix(".yaml")
    with whole_file(file) as temporary:
        temporary.write_text(recipe_text(recipe), encoding="utf-8")
    return meshot(["make-cohort", str(file), str(inputs), "--jobs", "2"])


def train_segmentation(folder: Path, inputs: Path) -> int:
    """A network that finds white matter."""
    words = ["train-segmentation", "tiny", "--data", str(inputs), "-o", str(folder), "--device", "cpu"]
    return meshot([*words, *ONE])


def train_system(folder: Path, inputs: Path) -> int:
    """Flows from initial surfaces."""
    words = ["train", "windows", "tiny", "--data", str(inputs), "-o", str(folder), "--device", "cpu", *ONE]
    return meshot([*words, "--initial", str(folder.parent / "initial")])


def reconstruct(folder: Path, inputs: Path) -> int:
    """Surfaces from a scan; a whole folder is refused, so that there is nothing left to do."""
    if folder.exists():
        return 0
    return meshot(["reconstruct", str(SCAN), "-o", str(folder), "--initial-only", *ONE])


def reconstruct_study(folder: Path, inputs: Path) -> int:
    """A study of one participant from BIDS, as BIDS derivatives, and its table."""
    words = ["reconstruct", str(SCAN.parents[2]), str(folder), "participant", "--layout", "bids", "--initial-only"]
    return meshot([*words, *ONE])


def render_book(folder: Path, inputs: Path) -> int:
    """The whole book from its stored outputs."""
    import build

    return build.build("stored", folder)


def warm() -> None:
    """Load the kernels, so that no run has to."""
    points = torch.rand(20, 3, generator=torch.Generator().manual_seed(0))
    sliced_wasserstein(points.requires_grad_(), points.detach() + 1, random_directions(4, 3, 0)).backward()


LOGS = r"\.jsonl$|\.png$|timing\.json|report\.html"
#: The description of a study names the raw data by its place relative to the study, which every trial has elsewhere.
IN_STUDIES = r"|subjects\.tsv$|meshot\.log$|dataset_description\.json"
#: Cheap ones, of which ``make test`` kills a sample.
SAMPLE = [
    Writer("experiment", write_experiment),
    Writer("fit", write_fit),
    Writer("files", write_files),
]
EVERY = [
    *SAMPLE,
    Writer("make-cohort", make_cohort, timed=r"logs/"),
    Writer("train-segmentation", train_segmentation, r"state/|\.jsonl$", LOGS),
    Writer("train", train_system, r"state/|\.jsonl$", LOGS),
    Writer("reconstruct", reconstruct, timed=LOGS),
    # A full disk is the failure of a visit: it is recorded, the next visit is tried, and the status is 1.
    Writer("study", reconstruct_study, r"subjects\.tsv$|meshot\.log$|_error\.json$", LOGS + IN_STUDIES, failure=1),
    Writer("book", render_book, timed=r"\.buildinfo|searchindex\.js", failure=1),
]
NEEDS_COHORT = ("train-segmentation", "train")
