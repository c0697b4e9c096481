"""What the tests of an experiment share; a test file names its experiment's folder as ``FOLDER``."""

import contextlib
import functools
import importlib

import pytest
import torch
import yaml

from meshot.mesh.editing import laplacian_smoothing
from meshot.mesh.io import write_mesh
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import write_weights
from meshot.pipeline.training import InitialSurfaces
from meshot.provenance import read_results
from meshot.synth.cohorts import scans
from phantoms import write_phantom_cohort
from scripts import scripts_in


@pytest.fixture(scope="session", autouse=True)
def code_is_read_once(root):
    """What an experiment runs, which takes seconds to read, is the same for all tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(root / "experiments"))
        experiment = importlib.import_module("experiment")
        patch.setattr(experiment, "code_of_script", functools.cache(experiment.code_of_script))
        yield


@pytest.fixture
def part(request):
    """A module of the experiment by name, forgotten afterwards."""
    with scripts_in(request.module.FOLDER) as load:
        yield load


@pytest.fixture
def run(part):
    """The script of the experiment."""
    return part("run")


@pytest.fixture
def part_of(root):
    """A module of any experiment by the experiment's name and its own, for files that test several of them."""
    with contextlib.ExitStack() as stack:
        yield lambda experiment, name: stack.enter_context(scripts_in(root / "experiments" / experiment))(name)


@pytest.fixture(scope="module")
def config(request):
    """The experiment's configuration."""
    return yaml.safe_load((request.module.FOLDER / "config.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def record(request):
    """What is committed of the experiment: its results with their provenance."""
    return read_results(request.module.FOLDER / "results.json")


@pytest.fixture(scope="module")
def results(record):
    """The committed results alone."""
    return record["results"]


@pytest.fixture
def one_thread():
    """On one thread, as experiments run: their numbers then repeat."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def phantom_place(tmp_path_factory):
    """A phantom cohort with its initial surfaces: the true ones without folds, half a millimetre too small."""
    place = tmp_path_factory.mktemp("ddot")
    cohort = write_phantom_cohort(place / "alpha", ["train", "train", "validation", "test", "test", "test"])
    table = (cohort / "participants.tsv").read_text(encoding="utf-8").splitlines()
    table[-1] = table[-1].replace("template", "procedural")
    (cohort / "participants.tsv").write_text("\n".join(table) + "\n")
    network = SegmentationNetwork(2, 1, generator=0)
    write_weights(place / "segmentation.safetensors", network, {})
    surfaces = InitialSurfaces(place / "initial", network.float())
    for subject in scans(cohort):
        for side in ("left", "right"):
            smooth = laplacian_smoothing(subject.surface("white", side, "standard"), 10)
            centre = smooth.vertices.mean(dim=0)
            initial = smooth.with_vertices(centre + 0.94 * (smooth.vertices - centre))
            write_mesh(surfaces.path(subject, side, subject.standard()), initial)
    return place
