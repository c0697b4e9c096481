"""What the tests of pictures and pages share: no window, and one browser without a network for each file of tests."""

import matplotlib
import pytest

matplotlib.use("agg")

import matplotlib.pyplot as plt

from browser import offline_browser
from preflight import browser as browser_path


@pytest.fixture(autouse=True)
def closed():
    """No figure stays open."""
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def context():
    """A browser context that can open files and nothing else."""
    with offline_browser(browser_path()) as found:
        yield found
