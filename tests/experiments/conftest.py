"""What the tests of an experiment share; a test file names its experiment's folder as ``FOLDER``."""

import contextlib

import pytest
import torch
import yaml

from meshot.provenance import read_results
from scripts import scripts_in


@pytest.fixture
def part(request):
    """A module of the experiment by name, forgotten afterwards."""
    with scripts_in(request.module.FOLDER) as load:
        yield load


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
