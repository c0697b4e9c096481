"""Experiments' files: from the checkout, or fetched, checked and kept; and a chapter that runs alone with them."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from meshot import __version__
from meshot_book.notebook import CHECKSUMS, checksum_lines, experiment_files, experiment_folder

NAME = "blur"
FILE = f"{NAME}/results.json"


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """A folder outside any checkout, with an empty cache and no repository named."""
    monkeypatch.setattr(experiment_files, "_PACKAGE", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("MESHOT_REPOSITORY", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def repository(alone, root, monkeypatch):
    """A repository with the results of one experiment, on the branch ``main`` only."""
    folder = alone / "repository"
    (folder / "raw/main/experiments" / NAME).mkdir(parents=True)
    shutil.copy(root / "experiments" / FILE, folder / "raw/main/experiments" / FILE)
    monkeypatch.setenv("MESHOT_REPOSITORY", folder.as_uri() + "/")
    return folder


def test_the_committed_checksums_are_those_of_the_files(root):
    assert CHECKSUMS.read_text(encoding="utf-8") == checksum_lines(root / "experiments"), "run: make ledger"


def test_what_chapters_read_has_a_checksum(root):
    """By the last part of its name: a chapter that was handed out has no other files."""
    chapters = [path.read_text(encoding="utf-8") for path in sorted((root / "notebooks").glob("[0-9]*.md"))]
    endings = r"json|jsonl|yaml|csv|py|safetensors|safetensors\.gz"
    read = {name for text in chapters for name in re.findall(rf'[/"]([\w.]+\.(?:{endings}))"', text)}
    committed = {path.name for path in (root / "experiments").glob("*/**/*.*")}
    assert {"rates.json", "left_white.json"} <= read & committed
    assert read & committed <= {line.split("/")[-1] for line in CHECKSUMS.read_text(encoding="utf-8").splitlines()}


def test_chapters_find_experiments_by_name(root):
    chapters = [path.read_text(encoding="utf-8") for path in sorted((root / "notebooks").glob("[0-9]*.md"))]
    assert [text for text in chapters if "../experiments" in text] == []
    asked = {name for text in chapters for name in re.findall(r'experiment_folder\("(\w+)"\)', text)}
    known = {line.split()[1].split("/")[0] for line in CHECKSUMS.read_text(encoding="utf-8").splitlines()}
    assert len(asked) > 15
    # A chapter may ask whether the results of an experiment are there yet.
    awaited = {file.parent.name for file in (root / "experiments").glob("*/run.py")} - known
    assert asked <= known | awaited


def test_a_checkout_has_the_files(root, monkeypatch, tmp_path):
    assert experiment_folder(NAME) == root / "experiments" / NAME
    monkeypatch.chdir(tmp_path)
    assert experiment_folder(NAME) == root / "experiments" / NAME


def test_files_are_fetched_once(repository, root, monkeypatch):
    folder = experiment_folder(NAME)
    assert folder == repository.parent / "cache" / "meshot" / f"experiments-{__version__}" / NAME
    assert (folder / "results.json").read_bytes() == (root / "experiments" / FILE).read_bytes()
    assert [path.name for path in folder.iterdir()] == ["results.json"]
    monkeypatch.delenv("MESHOT_REPOSITORY")
    assert experiment_folder(NAME) == folder


def test_a_damaged_file_is_fetched_again(repository, root):
    file = experiment_folder(NAME) / "results.json"
    file.write_bytes(file.read_bytes()[:100])
    assert (experiment_folder(NAME) / "results.json").read_bytes() == (root / "experiments" / FILE).read_bytes()


def test_the_tag_of_the_version_comes_first(repository, root):
    tagged = repository / "raw" / f"v{__version__}" / "experiments" / FILE
    tagged.parent.mkdir(parents=True)
    shutil.move(repository / "raw/main/experiments" / FILE, tagged)
    assert (experiment_folder(NAME) / "results.json").read_bytes() == tagged.read_bytes()


def test_another_content_is_refused(repository):
    changed = repository / "raw/main/experiments" / FILE
    changed.write_text("{}")
    with pytest.raises(
        ValueError, match=r"blur/results.json could not be fetched .*match the known hash.*clone the repos"
    ):
        experiment_folder(NAME)
    assert [path for path in (repository.parent / "cache").rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("address", ["file:///nowhere", "no address", "http://127.0.0.1:9"])
def test_an_address_that_does_not_answer_is_named(alone, monkeypatch, address):
    monkeypatch.setenv("MESHOT_REPOSITORY", address)
    with pytest.raises(ValueError, match=f"{address}/raw/main/.*Check the address in MESHOT_REPOSITORY"):
        experiment_folder(NAME)


def test_without_a_repository_the_message_says_what_to_do(alone):
    with pytest.raises(ValueError, match=r"not on this machine.*%env MESHOT_REPOSITORY=\.\.\..*clone the repository"):
        experiment_folder(NAME)


def test_an_unknown_experiment_is_an_error():
    with pytest.raises(ValueError, match="no experiment 'blurr'; name one of axioms"):
        experiment_folder("blurr")


@pytest.mark.thorough
def test_a_chapter_runs_alone(repository, root):
    """Without checkout: the chapter in an empty folder, the book's package in another, files from the repository."""
    site, empty = repository.parent / "site", repository.parent / "empty"
    shutil.copytree(root / "src" / "meshot_book", site / "meshot_book")
    empty.mkdir()
    shutil.copy(root / "notebooks" / "10_beyond_the_theorem.ipynb", empty)
    read = {"convergence", "beyond_random", "transport_rates"}
    for name in read:
        shutil.copytree(root / "experiments" / name, repository / "raw/main/experiments" / name)
    run = [sys.executable, "-m", "jupyter", "nbconvert", "--to", "notebook", "--execute", "10_beyond_the_theorem.ipynb"]
    environment = os.environ | {"PYTHONPATH": f"{site}{os.pathsep}{root / 'src'}"}
    done = subprocess.run(run, cwd=empty, env=environment, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    cache = repository.parent / "cache" / "meshot" / f"experiments-{__version__}"
    assert {path.name for path in cache.iterdir()} == read
