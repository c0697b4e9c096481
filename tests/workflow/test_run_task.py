"""One task: it runs once for its settings, goes on after a kill, and says what is wrong."""

import json
import signal
import subprocess
import sys
import time

import pytest


@pytest.fixture
def task(part, toy):
    modules = {name: part(name) for name in ("run_task", "stale")}

    def call(action, *words):
        module = modules["run_task" if action in ("run", "collect") else "stale"]
        return module.main([action, *words, "--root", str(toy)])

    return call


def test_a_task_runs_once_for_its_settings(task, toy):
    assert task("list") == 1
    assert task("run", "raw_a", "raw_b", "sum", "sum", "copy", "page", "raw_a") == 0
    assert (toy / "log.txt").read_text(encoding="utf-8").split() == ["a", "b", "sum", "copy", "page"]
    assert task("collect") == 0
    assert task("list") == 0
    assert set(noted(toy)) == {"raw_a", "raw_b", "sum", "copy"}
    assert set(noted(toy)["sum"]["inputs"]) == {"raw_a", "raw_b"}


def test_other_settings_clear_what_is_there(task, toy, capsys):
    task("run", "raw_a", "raw_b", "sum", "copy", "page")
    task("collect")
    (toy / "build/raw/b.rest").touch()
    (toy / "recipes/b.yaml").write_text("# the same\nvalue: b\n")
    assert task("list") == 0
    (toy / "recipes/b.yaml").write_text("value: c\n")
    capsys.readouterr()
    assert task("list") == 1
    assert capsys.readouterr().out.splitlines() == [
        "sum: raw_b has changed (recipes/b.yaml has changed)",
        "page: sum runs",
        "2 results are out of date",
    ]
    assert task("run", "raw_b", "sum", "page") == 0
    assert not (toy / "build/raw/b.rest").exists()
    assert "value: c" in (toy / "page.txt").read_text(encoding="utf-8")
    # The page waits for whatever has run, also if the workflow was killed between the two.
    task("collect")
    assert task("list") == 0


def test_settings_that_come_back_are_computed_again(task, toy):
    task("run", "raw_b")
    (toy / "recipes/b.yaml").write_text("value: c\n")
    task("run", "raw_b")
    (toy / "recipes/b.yaml").write_text("value: b\n")
    task("run", "raw_b")
    assert (toy / "build/raw/b.txt").read_text(encoding="utf-8") == "value: b\n"


def test_a_failure_leaves_no_stamp(task, toy, capsys):
    (toy / "refuse").touch()
    assert task("run", "raw_a", "raw_b", "sum") == 1
    assert "sum failed with exit status 1" in capsys.readouterr().err
    (toy / "refuse").unlink()
    assert task("run", "sum") == 0
    graph = toy / "workflow/experiments.yaml"
    graph.write_text(graph.read_text(encoding="utf-8").replace("cp build/raw/b.txt later.txt &&", ""), encoding="utf-8")
    assert task("run", "later", "--planned") == 1
    assert "later ended without later.txt" in capsys.readouterr().err
    assert task("run", "nothing") == 1
    assert "no task is called nothing; there are raw_a" in capsys.readouterr().err


def noted(toy):
    return json.loads((toy / "experiments" / "digests.json").read_text(encoding="utf-8"))


def test_what_two_processes_note_at_the_same_moment_is_kept(part, task, toy):
    assert task("run", "raw_a", "raw_b", "sum", "copy") == 0
    first, second = (part("stale").opened(root=toy) for _ in range(2))
    assert first.entries == second.entries == {}
    for results, name in ((first, "sum"), (second, "copy")):
        results.note([results.graph.tasks[name]])
    assert set(noted(toy)) == {"sum", "copy"}


def test_a_note_waits_until_no_other_process_writes_one(part, task, toy):
    assert task("run", "raw_a", "copy") == 0
    command = [sys.executable, toy / "workflow/run_task.py", "collect", "--root", toy]
    with part("stale").locked(part("stale").opened(root=toy).state):
        waiting = subprocess.Popen(command)
        with pytest.raises(subprocess.TimeoutExpired):
            waiting.wait(timeout=5)
        assert not (toy / "experiments" / "digests.json").exists()
    assert waiting.wait(timeout=30) == 0
    assert set(noted(toy)) == {"raw_a", "copy"}


def test_settings_that_change_meanwhile_are_refused(task, toy, capsys):
    graph = toy / "workflow/experiments.yaml"
    graph.write_text(
        graph.read_text(encoding="utf-8").replace(
            "echo {name} >>", "sed -i s/value/other/ recipes/{name}.yaml && echo x >>"
        )
    )
    assert task("run", "raw_a") == 1
    assert "the settings of raw_a changed while it ran" in capsys.readouterr().err
    assert task("run", "raw_a") == 0


#: A command that writes its process to a file, and ends when the file ``go`` is there.
SLOW = "echo $$ > pid.txt && echo begun >> log.txt && while test ! -e go; do sleep 0.05; done && echo {name} >>"


def slow(toy, command=SLOW):
    graph = toy / "workflow/experiments.yaml"
    text = graph.read_text(encoding="utf-8")
    graph.write_text(text.replace("echo {name} >>", command), encoding="utf-8")


def started(toy):
    command = [sys.executable, toy / "workflow/run_task.py", "run", "raw_a", "--root", toy]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def until(condition, seconds=30.0):
    """Wait until a condition holds. Returns whether it did."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def lines(toy):
    file = toy / "log.txt"
    return file.read_text(encoding="utf-8").split() if file.is_file() else []


def is_gone(pid):
    """Whether a process has ended. One that its parent has not asked for yet is a zombie."""
    found = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, encoding="utf-8", check=False)
    return found.stdout.strip()[:1] in ("", "Z")


@pytest.fixture
def tidy(toy):
    """Lets every command of the toy end."""
    yield
    (toy / "go").touch()


@pytest.mark.parametrize(
    "sign",
    [signal.SIGTERM, *(pytest.param(sign, marks=pytest.mark.thorough) for sign in (signal.SIGINT, signal.SIGKILL))],
)
def test_the_command_of_a_task_ends_with_it(toy, tidy, sign):
    slow(toy)
    first = started(toy)
    assert until(lambda: lines(toy) == ["begun"])
    first.send_signal(sign)
    first.wait(timeout=30)
    pid = int((toy / "pid.txt").read_text(encoding="utf-8"))
    assert until(lambda: is_gone(pid), seconds=10)
    (toy / "go").touch()
    assert started(toy).wait(timeout=30) == 0
    assert lines(toy) == ["begun", "begun", "a"]


def test_a_command_that_goes_on_without_its_task_keeps_the_lock(toy, tidy):
    slow(toy, "trap '' TERM && " + SLOW)
    first = started(toy)
    assert until(lambda: lines(toy) == ["begun"])
    first.terminate()
    first.wait(timeout=30)
    second = started(toy)
    assert not until(lambda: lines(toy) != ["begun"], seconds=2)
    (toy / "go").touch()
    assert second.wait(timeout=30) == 0
    assert lines(toy) == ["begun", "a", "begun", "a"]


@pytest.mark.parametrize(
    ("value", "meaning"),
    [("yes", True), ("true", True), ("True", True), (True, True), ("no", False), ("FALSE", False), (False, False)],
)
def test_a_setting_is_yes_or_no(part, value, meaning):
    assert part("run_task").yes_or_no("planned", value) is meaning


@pytest.mark.parametrize("value", ["", "nope", "1", 1, 0, None])
def test_a_setting_that_is_neither_yes_nor_no_is_refused(part, value):
    with pytest.raises(ValueError, match=f"planned is {value}; it is yes, no, true or false: --config planned=yes"):
        part("run_task").yes_or_no("planned", value)
