"""The book, rendered once for all tests, and a browser without a network."""

from pathlib import Path

import pytest

import build
from browser import offline_browser
from preflight import browser as browser_path


@pytest.fixture(scope="session")
def html(tmp_path_factory) -> Path:
    """The book, rendered from the stored outputs with every warning an error."""
    into = tmp_path_factory.mktemp("book")
    assert build.build("stored", into) == 0
    return into / "html"


@pytest.fixture(scope="module")
def context():
    """A browser that can open files and nothing else."""
    with offline_browser(browser_path()) as found:
        yield found
