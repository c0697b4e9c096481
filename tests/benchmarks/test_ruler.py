"""The benchmark of the ruler, on surfaces small enough to be quick."""

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "ruler.py"


def test_every_part_is_timed():
    spec = importlib.util.spec_from_file_location("ruler_benchmark", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    rows = module.measured(2, 200, [20, 50])
    assert [row["part"] for row in rows][-3:] == ["all but EMD, floors included", "EMD, 20 points", "EMD, 50 points"]
    assert all(row["wall s"] > 0 and row["CPU s"] >= 0 for row in rows)
