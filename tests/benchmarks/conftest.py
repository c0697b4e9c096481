"""The scripts of the benchmarks."""

from pathlib import Path

import pytest

from scripts import scripts_in

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def part():
    """A module of the benchmarks by name."""
    with scripts_in(BENCHMARKS) as found:
        yield found
