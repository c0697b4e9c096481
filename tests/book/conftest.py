"""The book, rendered once for all tests, and a browser without a network."""

import os
from pathlib import Path

import pytest
from filelock import FileLock

import build
from browser import offline_browser
from preflight import browser as browser_path


@pytest.fixture(scope="session")
def html(tmp_path_factory) -> Path:
    """The book, rendered from the stored outputs with every warning an error; workers side by side share one."""
    base = tmp_path_factory.getbasetemp()
    into = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "book"
    into.parent.mkdir(exist_ok=True)
    with FileLock(into.with_suffix(".lock")):
        if not into.exists():
            assert build.build("stored", into) == 0
    return into / "html"


@pytest.fixture(scope="module")
def context():
    """A browser that can open files and nothing else."""
    with offline_browser(browser_path()) as found:
        yield found
