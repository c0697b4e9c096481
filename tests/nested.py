"""Nested lists and dictionaries of results, compared number by number."""

import pytest


def flattened(value, path=()):
    """Every entry by where it stands."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        return {key: x for name, item in items for key, x in flattened(item, (*path, name)).items()}
    return {path: value}


def require_equal(again, kept):
    """Check that both have the same entries. Numbers may differ as differences of rounded numbers do."""
    flat, wanted = flattened(again), flattened(kept)
    assert flat.keys() == wanted.keys()
    for key, value in wanted.items():
        assert flat[key] == (pytest.approx(value, rel=1e-3, abs=1e-4) if isinstance(value, float) else value), key
