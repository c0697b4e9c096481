"""The benchmark of the windowed loss, on surfaces small enough to be quick."""

import pytest

from meshot.provenance import read_results


@pytest.fixture
def windows(part):
    return part("windows")


def test_both_ways_are_timed_and_give_the_same_gradient(windows, tmp_path):
    words = ["--faces", "3000", "--windows", "5", "--directions", "3", "--repeats", "2", "--threads", "1"]
    assert windows.main([*words, "-o", str(tmp_path / "windows.json")]) == 0
    record = read_results(tmp_path / "windows.json")
    parts = record["results"]["parts"]
    assert [row["part"] for row in parts] == ["kernels", "window by window, PyTorch", "sliced, 3 directions"]
    assert all(row["CPU s"] > 0 and row["wall s"] > 0 for row in parts)
    assert 0 < record["results"]["gradients_differ_by"] < 1e-9  # two ways, and not one of them twice
    assert all(abs(n - 3000) < 30 for n in record["config"]["faces"])
    (target,) = record["results"]["targets"]
    found = parts[0]["wall s"]
    assert target == {"what": "kernels", "found_s": found, "limit_s": 0.25, "met": found <= 0.25}
