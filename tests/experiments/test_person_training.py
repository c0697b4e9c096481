"""The training of the networks of the package: its steps parse, come in order, and are not done twice."""

import sys
from pathlib import Path

import pytest

from meshot.cli import make_parser

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "person"


def names(stage):
    return [step.name for step in stage]


def test_every_step_is_a_command_that_parses_and_reads_what_earlier_ones_write(part, tmp_path):
    plan = part("train").stages(tmp_path, 2, "bfloat16", 4)
    assert [names(stage) for stage in plan] == [
        ["people_like"], ["oasis_like"], ["adni_like"], ["segmentation"], ["adaptation"], ["flow, left", "flow, right"],
    ]  # fmt: skip
    steps = [make_parser().parse_args(step.words) for stage in plan for step in stage]
    cohorts, (segmentation, adapted, *flows) = steps[:3], steps[3:]
    for cohort, recipe in zip(cohorts, part("train").COHORTS, strict=True):
        assert (cohort.recipe, cohort.subjects, cohort.jobs, cohort.standard) == (recipe, 4, 2, "white matter")
    folders = [cohort.folder for cohort in cohorts]
    assert (segmentation.data, segmentation.start) == ([cohorts[0].folder], None)
    assert segmentation.changes == ["training.precision=bfloat16"]
    assert (adapted.data, adapted.start) == (folders, segmentation.output / "segmentation.safetensors")
    assert adapted.changes == ["training.precision=bfloat16", part("train").ADAPTATION]
    for side, flow in zip(("left", "right"), flows, strict=True):
        assert flow.data == folders
        assert flow.segmentation == adapted.output / "segmentation.safetensors"
        assert flow.changes == [f"training.side={side}"]


def step_that(part, name, makes, code):
    """A step whose command is some Python code."""
    return part("train").Step(name, ("-c", code), makes)


@pytest.fixture
def as_python(part, monkeypatch):
    """Run the words of a step as an argument of Python, not of meshot."""
    train = part("train")
    monkeypatch.setattr(train, "SECONDS_BETWEEN_LOOKS", 0.02)
    real = train.subprocess.Popen
    monkeypatch.setattr(train.subprocess, "Popen", lambda words, env: real([sys.executable, *words[3:]], env=env))
    return train


def test_what_is_finished_is_not_done_again_and_a_failure_ends_the_others(as_python, part, tmp_path, capsys):
    done, new, log = tmp_path / "done", tmp_path / "new", tmp_path / "log"
    done.touch()
    write = f"import os; open({str(log)!r}, 'a').write(os.environ['OMP_NUM_THREADS']); open({str(new)!r}, 'w')"
    steps = [step_that(part, "first", done, "raise SystemExit(5)"), step_that(part, "second", new, write)]
    assert as_python.run_stage(steps, 2) == 0
    assert (new.exists(), log.read_text(encoding="utf-8")) == (True, "1")
    assert as_python.run_stage(steps, 2) == 0
    assert log.read_text(encoding="utf-8") == "1"
    assert capsys.readouterr().out.count("second: meshot") == 1
    slow = step_that(part, "slow", tmp_path / "never", "import time; time.sleep(60)")
    bad = step_that(part, "bad", tmp_path / "never", "raise SystemExit(5)")
    assert as_python.run_stage([slow, bad], 2) == 5
    assert as_python.run_stage([bad], 1) == 5


def test_the_command_lists_its_steps_and_stops_at_a_failure(as_python, part, tmp_path, monkeypatch, capsys):
    assert as_python.main(["-o", str(tmp_path), "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["missing"] * 7
    plan = [[step_that(part, "bad", tmp_path / "never", "raise SystemExit(3)")], None]
    monkeypatch.setattr(as_python, "stages", lambda *a: plan)
    monkeypatch.setattr(as_python.signal, "signal", lambda *a: None)
    assert as_python.main(["-o", str(tmp_path)]) == 3
    monkeypatch.setattr(as_python, "stages", lambda *a: [])
    assert as_python.main(["-o", str(tmp_path)]) == 0
    assert "weights in" in capsys.readouterr().out
