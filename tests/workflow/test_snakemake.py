"""Snakemake goes on after a kill, with the same results."""

import base64
import os
import signal
import subprocess
import sys
import time

import pytest


@pytest.mark.thorough
def test_a_killed_workflow_goes_on_and_ends_the_same(snakemake, toy, tmp_path):
    pause = toy / "workflow/experiments.yaml"
    text = pause.read_text(encoding="utf-8")
    pause.write_text(text.replace("&& echo sum", "&& sleep 30 && echo sum"))
    command = [sys.executable, "-m", "snakemake", "--cores", "2", "--nolock"]
    victim = subprocess.Popen(
        command, cwd=toy, env=os.environ, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    patience, copied = time.monotonic() + 60, toy / "build/workflow/experiments/use/copy"
    while not ((toy / "sum.txt").exists() and list(copied.glob("*.json"))) and victim.poll() is None:
        assert time.monotonic() < patience
        time.sleep(0.05)
    os.killpg(victim.pid, signal.SIGKILL)
    victim.wait()
    pause.write_text(text)
    found = snakemake(toy, "--nolock")
    assert found.returncode == 0, found.stdout
    lines = (toy / "log.txt").read_text(encoding="utf-8").split()
    assert sorted(lines) == ["a", "b", "copy", "page", "sum"], found.stdout
    assert (toy / "page.txt").read_text(encoding="utf-8") == "value: a\nvalue: b\nvalue: a\n"
    assert "Nothing to be done" in snakemake(toy, "--nolock").stdout
    # What waits for a request runs with one.
    assert snakemake(toy, "--nolock", "--config", "planned=yes").returncode == 0
    assert (toy / "log.txt").read_text(encoding="utf-8").split()[5:] == ["later"]


@pytest.mark.thorough
def test_a_task_that_ended_after_snakemake_was_killed_does_not_hide_the_others(snakemake, toy):
    """Snakemake notes the beginning of a task. The end was not noted, but the stamp of the task is there."""
    tasks = [sys.executable, toy / "workflow/run_task.py", "run", "raw_a", "copy"]
    subprocess.run(tasks, check=True, stdout=subprocess.DEVNULL)
    (stamp,) = (toy / "build/workflow/experiments/use/copy").glob("*.json")
    marker = toy / ".snakemake/incomplete" / base64.b64encode(str(stamp).encode()).decode()
    marker.parent.mkdir(parents=True)
    marker.write_text('{"external_jobid": null}', encoding="utf-8")
    found = snakemake(toy, "--nolock")
    assert found.returncode == 0, found.stdout
    lines = (toy / "log.txt").read_text(encoding="utf-8").split()
    assert sorted(lines) == ["a", "b", "copy", "page", "sum"], found.stdout


def test_planned_tasks_run_if_the_setting_says_yes_and_not_if_it_says_no(snakemake, toy):
    found = [snakemake(toy, "-n", "--config", f"planned={word}").stdout for word in ("yes", "no")]
    assert ["later" in said for said in found] == [True, False], found[1]
