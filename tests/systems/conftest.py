"""Toys of three kinds, where the registry looks for systems."""

from pathlib import Path

import pytest

import meshot.systems

TOYS = ("template", "chain", "implicit")


@pytest.fixture
def toys(monkeypatch):
    """The folder of the toys becomes part of the package, as if their files lay beside the others."""
    monkeypatch.setattr(meshot.systems, "__path__", [*meshot.systems.__path__, str(Path(__file__).parent / "toys")])
    return TOYS
