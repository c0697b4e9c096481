"""What every test stands on: checked annotations, pinned threads, a display for VTK."""

import importlib
import os
import random
import sys
from pathlib import Path

import hypothesis
import pytest
from jaxtyping import config
from xdist.scheduler import LoadFileScheduling

ROOT = Path(__file__).resolve().parent.parent
for folder in (
    "book",
    "tools",
    "experiments",
    "tests",
    "tests/files",
    "tests/fuzz",
    "tests/live",
    "tests/loss",
    "tests/mutation",
):
    sys.path.insert(0, str(ROOT / folder))
sys.modules["rfc3987_syntax"] = None  # see book/kernels.py

typechecker = importlib.import_module("typechecker")
if not os.environ.get("MESHOT_UNCHECKED"):
    typechecker.install("meshot", "meshot_book")


# The same drawn problems in every run, and nothing written into the checkout, which may be read-only.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("repeatable")

#: Files that take long go first, so that no core waits for one of them at the end; notebooks follow, the longest first.
LONG_FILES = (
    "workflow/test_miniature.py",
    "book/test_reading.py",
    "experiments/test_comparison.py",
    "synth/test_cohorts.py",
    "pipeline/test_report.py",
    "book/test_plain.py",  # both this and the first need the rendered book: the other core would wait for it
    "loss/test_error_bar.py",
    "loss/test_drawn_problems.py",
    "book/test_extensions.py",
    "experiments/test_ddot.py",
    "flow/test_fitting.py",
    "pipeline/test_pretended_cuda.py",
    "experiments/test_readings.py",
    "pipeline/test_reconstruction.py",
    "systems/test_whole_scan_systems.py",
    "systems/test_deformation_training.py",
    "workflow/test_stale.py",
    "fuzz/test_fuzz.py",
    "kills/test_kills.py",
    "everywhere/test_everywhere.py",
)


#: Only ``make test-all`` runs these: second processors, damaged files, kills, mutants, and the workflow in small.
THOROUGH = ("everywhere/", "fuzz/", "kills/", "mutation/", "workflow/test_miniature.py")


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their marks
def pytest_collection_modifyitems(items):
    """Put long files first."""
    places = {item: item.path.relative_to(ROOT / "tests").as_posix() for item in items}
    ranks = {name: rank for rank, name in enumerate((*LONG_FILES, "test_every_notebook.py"))}
    items.sort(key=lambda item: ranks.get(places[item], len(ranks)))
    for item in items:
        if places[item].startswith(THOROUGH):
            item.add_marker(pytest.mark.thorough)


class ByFile(LoadFileScheduling):
    """Tests of a file share what they build and stay on one core; a notebook is alone.

    The mark ``xdist_group`` would say the same. xdist 3.8 appends it to the name of a test in a way that pytest 9.2 no
    longer sees, so that it does nothing (pytest-xdist, issue 1386).
    """

    def _split_scope(self, nodeid):
        return nodeid if "test_every_notebook.py" in nodeid else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give tests to the workers file by file."""
    return ByFile(config, log)


@pytest.fixture(autouse=True)
def same_checks_every_run():
    """Seed the draw by which beartype picks the one item of a list that it looks at; check the first calls anew."""
    random.seed(int(os.environ.get("MESHOT_CHECK_SEED", "0")))
    typechecker.calls.clear()


@pytest.fixture
def unchecked():
    """Switch jaxtyping's checks off, so that a test of bad input reaches the door of the function itself."""
    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def root() -> Path:
    """The top folder of the checkout."""
    return ROOT
