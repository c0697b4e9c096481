"""What the tests of live figures share: a browser without a network."""

import pytest

from browser import offline_browser
from preflight import browser as browser_path


@pytest.fixture(scope="module")
def context():
    """A browser context that can open files and nothing else."""
    with offline_browser(browser_path()) as found:
        yield found
