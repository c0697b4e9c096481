"""The benchmark of a study: what a process used, and the table of what many scans cost."""

import sys

import pytest

from meshot.provenance import read_results


def test_processor_time_and_memory_are_those_of_the_process(part):
    module = part("study_cost")
    idle = module.measured([sys.executable, "-c", "import time; time.sleep(0.5)"])
    busy = module.measured(
        [sys.executable, "-c", "x = bytearray(200_000_000)\nwhile __import__('time').process_time() < 1: 0"]
    )
    assert idle["wall s"] >= 0.5
    assert idle["CPU s"] < 0.5
    assert 1 <= busy["CPU s"] <= busy["wall s"] + 0.1
    assert busy["memory MB"] - idle["memory MB"] == pytest.approx(200, rel=0.1)
    with pytest.raises(RuntimeError, match="ended with 3"):
        module.measured([sys.executable, "-c", "raise SystemExit(3)"])


def test_the_table_multiplies_the_median(part, tmp_path, monkeypatch):
    module, costs = part("study_cost"), iter([30.0, 36.0, 90.0])
    monkeypatch.setattr(
        module, "reconstruction",
        lambda *_: {"CPU s": next(costs), "wall s": 40.0, "memory MB": 1500.0, "files MB": 20.0},
    )  # fmt: skip
    assert module.main(["-o", str(tmp_path / "found.json")]) == 0
    record = read_results(tmp_path / "found.json")
    assert record["results"]["scan"]["CPU s"] == 36.0
    lines = part("speed_page").study_block(record).splitlines()
    assert "takes 36 processor seconds and 1\u202f500 MB of memory, and leaves 20 MB of files" in lines[0]
    # 100 000 scans of 36 s are 1000 core hours: 5.2 days on 8 cores, 117 minutes on 512.
    assert lines[-2] == "| 1\u202f000 | 10 | 75 minutes | 1.2 minutes | 20 GB |"
    assert lines[-1] == "| 100\u202f000 | 1\u202f000 | 5.2 days | 120 minutes | 2\u202f000 GB |"
