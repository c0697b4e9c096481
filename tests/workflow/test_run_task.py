"""One task: it runs once for its settings, goes on after a kill, and says what is wrong."""

import json

import pytest


@pytest.fixture
def task(part, toy):
    module = part("run_task")
    return lambda *words: module.main([*words, "--root", str(toy)])


def test_a_task_runs_once_for_its_settings(task, toy):
    assert task("why") == 1
    assert task("run", "raw_a", "raw_b", "sum", "sum", "copy", "page", "raw_a") == 0
    assert (toy / "log.txt").read_text(encoding="utf-8").split() == ["a", "b", "sum", "copy", "page"]
    assert task("collect") == 0
    assert task("why") == 0
    entries = json.loads((toy / "workflow" / "standing.json").read_text(encoding="utf-8"))
    assert set(entries) == {"sum", "copy"}
    assert set(entries["sum"]["after"]) == {"raw_a", "raw_b"}


def test_other_settings_clear_what_is_there(task, toy, capsys):
    task("run", "raw_a", "raw_b", "sum", "copy", "page")
    task("collect")
    (toy / "build/raw/b.rest").touch()
    (toy / "recipes/b.yaml").write_text("# the same\nvalue: b\n")
    assert task("why") == 0
    (toy / "recipes/b.yaml").write_text("value: c\n")
    capsys.readouterr()
    assert task("why") == 1
    assert capsys.readouterr().out.splitlines() == ["sum: raw_b has other settings", "page: sum runs"]
    assert task("run", "raw_b", "sum", "page") == 0
    assert not (toy / "build/raw/b.rest").exists()
    assert "value: c" in (toy / "page.txt").read_text(encoding="utf-8")
    # The page waits for whatever has run, also if the workflow was killed between the two.
    task("collect")
    assert task("why") == 0


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


def test_a_result_made_by_hand_stands_if_its_record_agrees(task, toy, capsys):
    graph, place = toy / "workflow/experiments.yaml", toy / "record.json"
    entry = "  hand:\n    stage: use\n    command: x\n    reads: [recipes/a.yaml]\n    writes: [record.json]\n"
    graph.write_text(graph.read_text(encoding="utf-8") + entry + "    record: record.json\n", encoding="utf-8")
    assert task("stands", "hand") == 1
    assert "hand has no record.json; run it first" in capsys.readouterr().err
    place.write_text(json.dumps({"config": {"value": "b"}}))
    assert task("stands", "hand") == 1
    assert "record.json was made with other settings than recipes/a.yaml" in capsys.readouterr().err
    place.write_text(json.dumps({"config": {"value": "a"}}))
    assert task("stands", "hand") == 0
    assert "hand" in json.loads((toy / "workflow" / "standing.json").read_text(encoding="utf-8"))
