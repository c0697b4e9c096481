"""The whole graph in small: one command makes heads, trains every system, measures all, and does so after a kill."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from safetensors.numpy import load_file

GRAPH = ("--nolock", "--config", "graph=miniature")
SYSTEMS = {"deepcsr", "vox2cortex", "corticalflow", "cortexode", "ddot", "windows", "classical"}
STATES, WEIGHTS = Path("build/miniature/comparison"), Path("build/miniature/weights")
#: Where a finished trial or training is kept.
KEPT = (STATES / "trials", WEIGHTS)
STAMPS = Path("build/workflow/miniature")
#: Seconds until a training must have begun.
PATIENCE = 1800


def unfinished(clone: Path) -> list[str]:
    """The trainings that have saved a state and are not finished."""
    begun = {place.relative_to(clone / STATES).parts[0] for place in (clone / STATES).rglob("training.safetensors")}
    return sorted(begun - {place.name for folder in KEPT for place in (clone / folder).glob("*")})


def killed_in_a_training(clone: Path) -> str:
    """Start the graph, and kill everything when a training has saved a state. Returns its system."""
    victim = subprocess.Popen(
        [sys.executable, "-m", "snakemake", "--cores", "2", *GRAPH], cwd=clone, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    end = time.monotonic() + PATIENCE
    names: list[str] = []
    while not names and victim.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
        names = unfinished(clone)
    os.killpg(victim.pid, signal.SIGKILL)
    victim.wait()
    assert names, "the graph ended, or time was up, before a training had saved a state"
    return next(system for system in SYSTEMS if system in names[0].split("_"))


def printed(clone: Path) -> str:
    """What the tasks printed, for the message of a failure."""
    return "".join(f"\n{file.name}:\n{file.read_text()[-2000:]}" for file in sorted((clone / STAMPS).rglob("*.log")))


def outcome(clone: Path) -> tuple[dict[str, dict[str, bytes]], list[dict]]:
    """All weights, to the bit, and the measurements of every head without their seconds.

    A file of weights also holds its record, and that the seconds of its training.
    """
    files = {str(file.relative_to(clone)): load_file(file) for file in (clone / WEIGHTS).rglob("*.safetensors")}
    weights = {name: {part: value.tobytes() for part, value in file.items()} for name, file in files.items()}
    with (clone / "build/miniature/results/subjects.csv").open(encoding="utf-8", newline="") as file:
        return weights, [{**row, "cpu_seconds": ""} for row in csv.DictReader(file)]


def forget(clone: Path, system: str) -> None:
    """Remove what a system has learned, and the measurements."""
    for folder in (STATES, *KEPT):
        for place in (clone / folder).glob(f"*_{system}_*"):
            shutil.rmtree(place)
    rates = clone / "build/miniature/rates.json"
    record = json.loads(rates.read_text(encoding="utf-8"))
    record["results"].pop(system, None)  # a system without rates has no entry
    rates.write_text(json.dumps(record), encoding="utf-8")
    shutil.rmtree(clone / "build/miniature/results")
    for place in (clone / STAMPS / "training" / f"training_{system}", clone / STAMPS / "evaluation"):
        shutil.rmtree(place)


def test_the_whole_graph_in_small_also_after_a_kill(snakemake, fresh, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    clone = fresh(tmp_path / "clone")
    system = killed_in_a_training(clone)
    found = snakemake(clone, *GRAPH)
    assert found.returncode == 0, found.stdout + printed(clone)
    weights, rows = outcome(clone)
    assert {row["arm"] for row in rows} == SYSTEMS | {"initial", "perfect"}
    assert {row["subject"] for row in rows} == {"sub-003"}
    assert all(float(row["assd_mm"]) >= 0 for row in rows if not row["failed"])
    assert (clone / "build/miniature/results/pairs.csv").is_file()
    assert "Nothing to be done" in snakemake(clone, *GRAPH).stdout
    # The system that was killed, trained once more without a kill.
    forget(clone, system)
    found = snakemake(clone, *GRAPH)
    assert found.returncode == 0, found.stdout + printed(clone)
    again, rows_again = outcome(clone)
    assert again.keys() == weights.keys()
    # A comparison of all values would print megabytes.
    assert [name for name in weights if again[name] != weights[name]] == []
    assert rows_again == rows
