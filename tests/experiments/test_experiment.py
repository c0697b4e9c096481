"""The one runner: a killed run goes on, other code and settings begin anew, and the command line says what there is."""

import contextlib
import json
import runpy
import sys
from pathlib import Path

import pytest

from meshot.provenance import read_results
from scripts import scripts_in

EXPERIMENTS = Path(__file__).resolve().parents[2] / "experiments"
SCRIPT = '''"""Halves of numbers."""
from part import half

def work(task):
    return half(task)
'''
PART = "def half(number):\n    return number / 2\n\ndef unused():\n    return 1\n"
CONFIG = "numbers: [1, 2, 3]\ngrid: {margin: 4}\n"
OTHERS = {"run.py": ("half(task)", "half(task + 1)"), "part.py": ("/ 2", "/ 3"), "config.yaml": ("4", "5")}
SAME = {"run.py": ("Halves of", "# Half the"), "part.py": ("return 1", "return 2")}


@pytest.fixture
def runner(monkeypatch, tmp_path):
    with scripts_in(EXPERIMENTS) as load:
        found = load("experiment")
        monkeypatch.setattr(found, "ROOT", tmp_path)
        code = sys.modules["stale"].Code  # without the package, which takes seconds to read
        monkeypatch.setattr(found, "code_of_script", lambda script: code(script.parent).digest([script.stem]))
        yield found


@pytest.fixture
def toy(runner, tmp_path):
    """Runs an experiment with two files of code. Returns the tasks that were done."""
    place = tmp_path / "experiments" / "toy"
    place.mkdir(parents=True)
    for name, text in {"run.py": SCRIPT, "part.py": PART, "config.yaml": CONFIG}.items():
        (place / name).write_text(text)

    def run(*words, killed_at=None, results=lambda rows, config: {"sum": sum(r["found"] for r in rows)}, **more):
        done = []

        def work(task, config):
            if task == killed_at:
                raise KeyboardInterrupt
            done.append(task)
            return task / config["grid"]["margin"]

        script = str(place / "run.py")
        runner.run(script, lambda config: config["numbers"], work, results, "numbers", words=list(words), **more)
        return done

    run.place, run.partial = place, place / "partial.jsonl"
    return run


def killed(toy, at):
    with pytest.raises(KeyboardInterrupt):
        toy(killed_at=at)


def changed(file, before, after):
    text = file.read_text(encoding="utf-8")
    assert before in text
    file.write_text(text.replace(before, after))


def test_a_killed_run_goes_on_and_ends_as_one_that_was_not(toy):
    assert toy() == [1, 2, 3]
    whole = read_results(toy.place / "results.json")
    killed(toy, 3)
    with toy.partial.open("a") as file:
        file.write('{"task": {"par')  # killed in the midst of a line
    for name, words in SAME.items():
        changed(toy.place / name, *words)
    assert toy() == [3]
    again = read_results(toy.place / "results.json")
    assert (again["results"], again["config"]) == (whole["results"], whole["config"]) == ({"sum": 1.5}, again["config"])
    assert again["command"] == "python experiments/toy/run.py"
    assert [path.name for path in toy.place.glob("partial*")] == []


@pytest.mark.parametrize("name", OTHERS)
def test_other_code_and_other_settings_begin_anew_and_the_same_ones_count_again(toy, name):
    killed(toy, 3)
    changed(toy.place / name, *OTHERS[name])
    with pytest.warns(UserWarning, match=r"partial.jsonl holds 2 tasks that another configuration or other code"):
        killed(toy, 2)
    changed(toy.place / name, *reversed(OTHERS[name]))
    with pytest.warns(UserWarning, match="holds 1 tasks"):
        assert toy() == [3]


def test_what_a_task_depends_on_may_be_less_than_the_configuration(toy):
    killed(toy, 3)
    changed(toy.place / "config.yaml", "3]", "3, 5]")
    with pytest.warns(UserWarning, match="2 tasks"):
        killed(toy, 3)
    toy.partial.unlink()
    depends = {"depends": lambda config: config["grid"]}
    with pytest.raises(KeyboardInterrupt):
        toy(killed_at=3, **depends)
    changed(toy.place / "config.yaml", "3, 5]", "3]")
    assert toy(**depends) == [3]


def test_tasks_are_kept_as_long_as_something_is_missing(toy):
    for missing in ([2], []):
        toy(results=lambda rows, config, missing=missing: {"missing": missing})
        assert toy.partial.is_file() == bool(missing)


def test_a_state_of_other_settings_is_not_found(toy):
    places = []

    def results(rows, config):
        places.append(config.place)
        assert config.place.is_dir()
        return {"missing": [1]}

    toy(results=results)
    changed(toy.place / "config.yaml", *OTHERS["config.yaml"])
    with pytest.warns(UserWarning, match="3 tasks"):
        toy(results=results)
    assert len(set(places)) == 2


def test_the_command_line_says_what_there_is(toy, capsys):
    with pytest.raises(SystemExit) as ended:
        toy("--help")
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert [
        words for words in ("Halves of numbers", "Settings: numbers, grid", "--set", "--only") if words not in shown
    ] == []
    assert toy("--list") == []
    assert capsys.readouterr().out == "1 1\n2 2\n3 3\n"
    assert toy("--only", "2") == [2]
    assert json.loads(capsys.readouterr().out)["found"] == 0.5
    assert not (toy.place / "results.json").exists()
    assert toy("--early") == []
    assert read_results(toy.place / "results.json")["results"] == {"sum": 0.5}
    with pytest.raises(SystemExit):
        toy("--only", "nothing")
    assert "no task is or contains nothing" in capsys.readouterr().err


def test_other_settings_have_results_of_their_own(toy, tmp_path, capsys):
    option = {"options": {"made_in": ("--made-in", {"default": "a"})}}
    assert toy("--set", "numbers=[4]", "grid.margin=2", **option) == [4]
    record = read_results(tmp_path / "build" / "experiments" / "toy" / "results.json")
    assert record["results"] == {"sum": 2.0}
    assert record["config"] == {"numbers": [4], "grid": {"margin": 2}}
    assert record["command"] == "python experiments/toy/run.py --set numbers=[4] grid.margin=2"
    assert not (toy.place / "results.json").exists()
    other = tmp_path / "other.yaml"
    other.write_text(CONFIG.replace("3]", "6]"))
    assert toy("--config", str(other), "-o", str(tmp_path / "out" / "r.json")) == [1, 2, 6]
    assert (tmp_path / "out" / "r.json").is_file()
    for words, message in (("grid.edge=2", "write KEY=VALUE with one of margin"), ("numbers=[", "is not YAML")):
        with pytest.raises(SystemExit):
            toy("--set", words)
        assert message in capsys.readouterr().err


def test_what_is_not_json_is_refused_before_it_is_kept(runner, tmp_path):
    with pytest.raises(TypeError):
        runner.run_jobs([1], lambda task: {1, 2}, tmp_path / "partial.jsonl", "a", "b")
    assert not (tmp_path / "partial.jsonl").exists()


#: Experiments whose tasks come from what is not in the repository.
WITH_DATA = {"cohorts", "comparison", "correspondence", "ddot", "grid_floor", "people", "person", "segmentation"}
WITH_DATA |= {"new_heads", "template_baseline"}
SCRIPTS = sorted(EXPERIMENTS.glob("*/run.py"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.parent.name)
def test_every_experiment_lists_its_tasks(script, monkeypatch, capsys):
    words = "--help" if script.parent.name in WITH_DATA else "--list"
    monkeypatch.setattr(sys, "argv", [str(script), words])
    with scripts_in(script.parent), contextlib.suppress(SystemExit):
        runpy.run_path(str(script), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert lines
    if words == "--list":
        assert len({line.split(" ", 1)[1] for line in lines}) == len(lines)
    else:
        assert "Settings: " in " ".join(lines)
