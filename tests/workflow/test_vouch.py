"""Vouching: a small part is run with the code of then and of now, and only equal numbers are stamped."""

import json
import subprocess

import pytest

GRAPH = """
stages:
  use: {cores: 1, memory_mb: 100, minutes: 1, cuda: 0}
tasks:
  sum:
    stage: use
    command: python experiments/sum/run.py
    writes: [experiments/sum/results.json]
"""
SCRIPT = """import json, sys


def total():
    return sum([1, 2, 3])


if __name__ == "__main__":
    place = sys.argv[1] if len(sys.argv) > 1 else "experiments/sum/results.json"
    open(place, "w").write(json.dumps({"total": total(), "seconds": id(place)}))
"""
SMALL = "python experiments/sum/run.py {out}/results.json"


@pytest.fixture
def place(part, tmp_path):
    """A repository with one result, its digests, and one commit."""
    for name, text in {"workflow/experiments.yaml": GRAPH, "experiments/sum/run.py": SCRIPT, "src/x.py": ""}.items():
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "experiments/sum/results.json").write_text('{"total": 6}', encoding="utf-8")
    results = part("stale").opened(root=tmp_path)
    results.note(results.graph.tasks.values())
    (tmp_path / ".gitignore").write_text("build\n", encoding="utf-8")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    commit(tmp_path)
    return tmp_path


def commit(place):
    for words in (["add", "-A"], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "all"]):
        subprocess.run(["git", *words], cwd=place, check=True)


def write(place, old, new):
    (place / "experiments/sum/run.py").write_text(SCRIPT.replace(old, new), encoding="utf-8")


@pytest.fixture
def vouch(part, place):
    """Vouch for the result on the command line: the status."""
    words = ["vouch", "sum", "--root", str(place), "--reason", "moved", "--small", SMALL]
    return lambda *more: part("stale").main([*words, *more])


def stale(part, place):
    return part("stale").opened(root=place).stale()


def test_equal_numbers_are_stamped_and_the_reason_is_logged(part, place, vouch):
    write(place, "sum([1, 2, 3])", "1 + 2 + 3")
    assert stale(part, place) == {"sum": ["its code has changed"]}
    assert vouch() == 0
    assert stale(part, place) == {}
    (line,) = map(json.loads, (place / "experiments/vouched.jsonl").read_text(encoding="utf-8").splitlines())
    assert (line["names"], line["reason"]) == (["sum"], "moved")
    assert ": all 1 values are those of " in line["shown"]


def test_other_numbers_are_refused(part, place, vouch, capsys):
    write(place, "1, 2, 3", "1, 2, 4")
    assert vouch() == 1
    assert "1 of 1 values differ" in capsys.readouterr().err
    assert stale(part, place) == {"sum": ["its code has changed"]}
    assert not (place / "experiments/vouched.jsonl").exists()


def test_code_that_is_not_in_the_history_is_refused_until_a_commit_is_named(part, place, vouch, capsys):
    digests = place / "experiments/sum/digests.json"
    digests.write_text(digests.read_text(encoding="utf-8").replace('"code": "', '"code": "0'), encoding="utf-8")
    assert vouch() == 1
    assert "the history does not have the code of sum" in capsys.readouterr().err
    assert vouch("--then", "nowhere") == 1
    assert "the history does not have nowhere" in capsys.readouterr().err
    assert vouch("--then", "HEAD") == 0
    assert stale(part, place) == {}


def test_a_part_that_leaves_nothing_or_other_values_shows_nothing(part, place, vouch, capsys):
    write(place, '"total": total(), ', '"sum": total(), ')
    assert vouch() == 1
    assert "only one of both has results.json/0/sum" in capsys.readouterr().err
    assert vouch("--small", "true {out}") == 1
    assert "has left 0 values, and now 0" in capsys.readouterr().err
    assert vouch("--small", "true") == 1
    assert "it must write into the folder {out}" in capsys.readouterr().err


def test_states_are_compared_although_their_folder_is_called_after_the_code(part, place, vouch):
    kept = """
    import hashlib, pathlib
    state = pathlib.Path(place).parent / "partial" / hashlib.sha256(open(__file__, "rb").read()).hexdigest()[:16]
    state.mkdir(parents=True)
    (state / "state.json").write_text(json.dumps({"half": total() / 2}))
"""
    script = SCRIPT.replace("    open(place", f"{kept}    open(place")
    (place / "experiments/sum/run.py").write_text(script, encoding="utf-8")
    part("stale").opened(root=place).note(part("stale").opened(root=place).graph.tasks.values())
    commit(place)
    (place / "experiments/sum/run.py").write_text(script.replace("sum([1, 2, 3])", "1 + 2 + 3"), encoding="utf-8")
    assert stale(part, place)
    assert vouch() == 0
    assert not stale(part, place)
    (place / "experiments/sum/run.py").write_text(script.replace("total() / 2", "total() / 3"), encoding="utf-8")
    assert vouch() == 1  # a state with another number


def test_a_part_runs_once_for_all_tasks_that_name_it(part, place):
    again = (
        GRAPH.split("tasks:")[1]
        .replace("sum:", "again:")
        .replace("experiments/sum/results", "experiments/again/results")
    )
    (place / "workflow/experiments.yaml").write_text(GRAPH + again.lstrip("\n"), encoding="utf-8")
    (place / "experiments/again").mkdir()
    (place / "experiments/again/results.json").write_text('{"total": 6}', encoding="utf-8")
    results = part("stale").opened(root=place)
    results.note(results.graph.tasks.values())
    commit(place)
    write(place, "sum([1, 2, 3])", "1 + 2 + 3")
    assert set(stale(part, place)) == {"sum", "again"}
    runs = place / "build/runs"
    runs.parent.mkdir(exist_ok=True)
    small = f"sh -c 'echo run >> {runs}; {SMALL}'"
    assert (
        part("stale").main(["vouch", "sum", "again", "--root", str(place), "--reason", "moved", "--small", small]) == 0
    )
    assert stale(part, place) == {}
    assert runs.read_text(encoding="utf-8") == "run\nrun\n"  # with the code of then, and with that of now
    assert len((place / "experiments/vouched.jsonl").read_text(encoding="utf-8").splitlines()) == 2
