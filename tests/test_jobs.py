"""A run that is stopped anywhere ends in the same rows as one that is not, and other code or settings begin anew."""

import functools
import json

import pytest

from meshot import jobs
from meshot.jobs import fingerprint, finished_tasks

TASKS = [{"seed": seed, "loss": loss} for seed in (0, 1) for loss in ("a", "b")]
CONFIG = {"n_points": 10, "seeds": [0, 1]}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An experiment of one script, beside a package of one module."""
    for name in ("experiment/run.py", "package/sliced.py"):
        path = tmp_path / name
        path.parent.mkdir()
        path.write_text("x = 1\n")
    monkeypatch.setattr(jobs, "PACKAGE", tmp_path / "package")
    return tmp_path / "experiment"


@pytest.fixture
def run(folder):
    return functools.partial(jobs.run_jobs, folder=folder, config=CONFIG)


def work(task):
    return {"value": task["seed"] + 0.5, "pair": (task["loss"], 1)}


def without_seconds(rows):
    return [(row["task"], row["found"]) for row in rows]


def test_rows_come_in_order_with_their_seconds(run, tmp_path):
    ticks = iter(range(100))
    rows = run(TASKS, work, tmp_path / "new/folder/partial.jsonl", clock=lambda: next(ticks))
    assert [row["task"] for row in rows] == TASKS
    assert rows[2]["found"] == {"value": 1.5, "pair": ["a", 1]}
    assert [row["seconds"] for row in rows] == [1, 1, 1, 1]


@pytest.mark.parametrize("cut", [0, 7])
def test_a_stopped_run_goes_on_and_ends_alike(run, tmp_path, cut):
    whole, partial, seen = tmp_path / "whole.jsonl", tmp_path / "partial.jsonl", []
    expected = run(TASKS, work, whole)
    lines = whole.read_text(encoding="utf-8").splitlines(keepends=True)
    partial.write_text("".join(lines[:2]) + lines[2][:cut])  # killed while it wrote the third

    def watched(task):
        seen.append(task)
        return work(task)

    assert without_seconds(run(TASKS, watched, partial)) == without_seconds(expected)
    assert seen == TASKS[2:]
    assert without_seconds(run(TASKS, pytest.fail, partial)) == without_seconds(expected)


@pytest.mark.parametrize("name", ["experiment/run.py", "experiment/more.py", "package/sliced.py", "config"])
def test_other_code_and_other_settings_begin_anew(folder, tmp_path, name):
    partial, config = tmp_path / "partial.jsonl", dict(CONFIG)
    jobs.run_jobs(TASKS[:3], work, partial, folder=folder, config=config)
    before = fingerprint(folder, config)
    if name == "config":
        config["n_points"] = 11
    else:
        (tmp_path / name).write_text("x = 2\n")
    assert fingerprint(folder, config) != before
    assert finished_tasks(TASKS, partial, folder=folder, config=config) == []
    with pytest.warns(UserWarning, match=r"partial.jsonl holds 3 tasks that another configuration or other code"):
        rows = jobs.run_jobs(TASKS, lambda task: "anew", partial, folder=folder, config=config)
    assert [row["found"] for row in rows] == ["anew"] * 4


def test_what_was_done_counts_again_when_the_code_is_as_it_was(run, folder, tmp_path):
    partial = tmp_path / "partial.jsonl"
    expected = run(TASKS, work, partial)
    (folder / "run.py").write_text("x = 2\n")
    with pytest.warns(UserWarning, match="4 tasks"):
        run(TASKS[:1], lambda task: "other", partial)
    (folder / "run.py").write_text("x = 1\n")
    with pytest.warns(UserWarning, match="1 tasks"):
        assert without_seconds(run(TASKS, pytest.fail, partial)) == without_seconds(expected)


def test_results_and_caches_are_not_code(folder):
    before = fingerprint(folder, CONFIG)
    for name in ("results.json", "partial.jsonl", "run.pyc"):
        (folder / name).write_text("{}")
    assert fingerprint(folder, dict(reversed(CONFIG.items()))) == before


def test_the_package_is_hashed_too(folder, monkeypatch):
    monkeypatch.undo()
    assert (jobs.PACKAGE / "jobs.py").is_file()


def test_finished_tasks_are_those_that_are_not_done_again(run, folder, tmp_path):
    partial = tmp_path / "partial.jsonl"
    assert finished_tasks(TASKS, partial, folder=folder, config=CONFIG) == []
    run(TASKS[1:3], work, partial)
    assert finished_tasks(TASKS, partial, folder=folder, config=CONFIG) == TASKS[1:3]


def test_a_task_may_be_any_json(run, tmp_path):
    tasks = ["name", ["list", 1.5], {"none": None}]
    for _ in range(2):
        rows = run(tasks, lambda task: [task], tmp_path / "partial.jsonl")
        assert [row["found"] for row in rows] == [[task] for task in tasks]
    assert [
        json.loads(line)["task"] for line in (tmp_path / "partial.jsonl").read_text(encoding="utf-8").splitlines()
    ] == tasks


def test_what_is_not_json_is_refused_before_it_is_kept(run, tmp_path):
    with pytest.raises(TypeError):
        run([1], lambda task: {1, 2}, tmp_path / "partial.jsonl")
    assert not (tmp_path / "partial.jsonl").exists()
