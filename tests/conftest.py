"""What every test stands on: checked annotations, pinned threads, a display for VTK."""

import os
import random
import sys
from pathlib import Path

import pytest
from jaxtyping import config, install_import_hook

ROOT = Path(__file__).resolve().parent.parent
for folder in ("book", "tools", "tests", "tests/fuzz"):
    sys.path.insert(0, str(ROOT / folder))

if not os.environ.get("MESHOT_UNCHECKED"):
    install_import_hook(["meshot", "meshot_book"], "typechecker.check")


@pytest.fixture(autouse=True)
def same_checks_every_run():
    """Seed the draw by which beartype picks the one item of a list that it looks at."""
    random.seed(int(os.environ.get("MESHOT_CHECK_SEED", "0")))


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
