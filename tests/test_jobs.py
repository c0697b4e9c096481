"""A run that is stopped anywhere ends in the same rows as one that is not."""

import pytest

from meshot.jobs import run_jobs

TASKS = [{"seed": seed, "loss": loss} for seed in (0, 1) for loss in ("a", "b")]


def work(task):
    return {"value": task["seed"] + 0.5, "pair": (task["loss"], 1)}


def without_seconds(rows):
    return [(row["task"], row["found"]) for row in rows]


def test_rows_come_in_order_with_their_seconds(tmp_path):
    ticks = iter(range(100))
    rows = run_jobs(TASKS, work, tmp_path / "new/folder/partial.jsonl", clock=lambda: next(ticks))
    assert [row["task"] for row in rows] == TASKS
    assert rows[2]["found"] == {"value": 1.5, "pair": ["a", 1]}
    assert [row["seconds"] for row in rows] == [1, 1, 1, 1]


@pytest.mark.parametrize("cut", [0, 7])
def test_a_stopped_run_goes_on_and_ends_alike(tmp_path, cut):
    whole, partial, seen = tmp_path / "whole.jsonl", tmp_path / "partial.jsonl", []
    expected = run_jobs(TASKS, work, whole)
    lines = whole.read_text().splitlines(keepends=True)
    partial.write_text("".join(lines[:2]) + lines[2][:cut])  # killed while it wrote the third

    def watched(task):
        seen.append(task)
        return work(task)

    assert without_seconds(run_jobs(TASKS, watched, partial)) == without_seconds(expected)
    assert seen == TASKS[2:]
    assert without_seconds(run_jobs(TASKS, pytest.fail, partial)) == without_seconds(expected)


def test_what_is_not_json_is_refused_before_it_is_kept(tmp_path):
    with pytest.raises(TypeError):
        run_jobs([1], lambda task: {1, 2}, tmp_path / "partial.jsonl")
    assert not (tmp_path / "partial.jsonl").exists()
