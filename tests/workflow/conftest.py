"""What the tests of the workflow share: its modules, copies of the repository with arbitrary times, a small graph."""

import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scripts import scripts_in

#: What the workflow reads and writes.
FOLDERS = ("workflow", "experiments", "src", "book", "benchmarks")
TOY = """
stages:
  make: {cores: 1, memory_mb: 100, minutes: 1, cuda: 0}
  use: {cores: 1, memory_mb: 100, minutes: 1, cuda: 0}
tasks:
  raw_{name}:
    stage: make
    each: {name: [a, b]}
    command: mkdir -p build/raw && grep -v '^#' recipes/{name}.yaml > build/raw/{name}.txt && echo {name} >> log.txt
    reads: ["recipes/{name}.yaml"]
    makes: ["build/raw/{name}.txt"]
    clears: ["build/raw/{name}.txt", "build/raw/{name}.rest"]
  sum:
    stage: use
    command: cat build/raw/*.txt > sum.txt && test ! -e refuse && echo sum >> log.txt
    after: ["raw_*"]
    writes: [sum.txt]
  copy:
    stage: use
    command: cp build/raw/a.txt copy.txt && echo copy >> log.txt
    after: [raw_a]
    writes: [copy.txt]
  later:
    stage: use
    command: cp build/raw/b.txt later.txt && echo later >> log.txt
    after: [raw_b]
    writes: [later.txt]
    planned: true
  page:
    stage: use
    command: cat sum.txt copy.txt > page.txt && echo page >> log.txt
    after: [sum, copy]
    writes: [page.txt]
    derived: true
"""


@pytest.fixture
def part(root):
    """A module of the folder ``workflow`` by name, forgotten afterwards."""
    with scripts_in(root / "workflow") as load:
        yield load


@pytest.fixture(scope="session")
def fresh(root, tmp_path_factory):
    """A function that copies the files of the repository, as a clone has them: their times say nothing."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", *FOLDERS],
        cwd=root,
        capture_output=True,
        encoding="utf-8",
        check=True,
    ).stdout.splitlines()
    names, draw = [name for name in listed if (root / name).is_file()], random.Random(0)
    original = tmp_path_factory.mktemp("fresh")
    for name in names:
        (original / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(root / name, original / name)
        os.utime(original / name, (draw.uniform(1e9, 2e9),) * 2)
    return lambda place: Path(shutil.copytree(original, place))


@pytest.fixture
def toy(root, tmp_path, monkeypatch):
    """A small workflow in a folder of its own: two recipes, two results, one that is planned, and a page."""
    shutil.copytree(root / "workflow", tmp_path / "workflow", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "workflow" / "experiments.yaml").write_text(TOY)
    (tmp_path / "recipes").mkdir()
    for name in ("a", "b"):
        (tmp_path / "recipes" / f"{name}.yaml").write_text(f"value: {name}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def snakemake(place: Path, *words: str) -> subprocess.CompletedProcess:
    """Snakemake in a folder, on two cores."""
    command = [sys.executable, "-m", "snakemake", "--cores", "2", *words]
    paths = [str(Path(__file__).resolve().parents[2] / "src"), os.environ.get("PYTHONPATH", "")]
    return subprocess.run(
        command, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
    )  # fmt: skip


@pytest.fixture(name="snakemake", scope="session")
def run_snakemake():
    """Snakemake in a folder, with its output. It belongs to the extra ``workflow``."""
    pytest.importorskip("snakemake")
    return snakemake
