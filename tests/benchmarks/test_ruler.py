"""The benchmark of the ruler, on surfaces small enough to be quick."""

import pytest

from meshot.provenance import read_results


@pytest.fixture
def ruler(part):
    return part("ruler")


def test_every_part_is_timed_and_kept(ruler, tmp_path):
    words = ["--subdivisions", "2", "--points", "200", "--emd-points", "20", "50", "-o", str(tmp_path / "ruler.json")]
    assert ruler.main(words) == 0
    record = read_results(tmp_path / "ruler.json")
    rows = record["results"]["parts"]
    assert [row["part"] for row in rows][-3:] == ["all but EMD, floors included", "EMD, 20 points", "EMD, 50 points"]
    assert all(row["wall s"] > 0 and row["CPU s"] >= 0 for row in rows)
    (target,) = record["results"]["targets"]
    assert target["found_s"] == rows[-3]["wall s"]
    assert target["met"] == (target["found_s"] <= 8)
    assert record["config"]["faces"] == 320
