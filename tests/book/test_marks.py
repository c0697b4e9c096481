"""Marks of notebooks whose answers are known: right, partly wrong, with a record that was edited, and beyond reason."""

import json
import re

import pytest

from meshot_book import marks
from meshot_book.exercises import report, verdict
from meshot_book.exercises.check import EXERCISES

HEAD = "import math\nfrom meshot_book.exercises import check"
NEEDED = "def points_needed(p, joint, first, second, tolerance):\n    return {}"
RIGHT = "math.ceil(root(p, joint, first + second, tolerance) ** 2)"
ROOT = (
    "%matplotlib inline\ndef root(p, joint, both, tolerance):\n    return p * joint ** (p - 1) * both / (2 * tolerance)"
)
DIAGNOSIS = """def diagnosis(seen, new, distance):
    return next((k for k, quotient in enumerate((seen, new, distance)) if quotient >= {}), 3)"""
CHECKS = ("check.points_needed(points_needed)", "check.diagnosis(diagnosis)")


def write_notebook(file, *codes):
    cells = [{"cell_type": "code", "source": code.splitlines(keepends=True)} for code in codes]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"cells": [{"cell_type": "markdown", "source": "# A"}, *cells], "nbformat": 4}))


def hand_in(folder, needed, threshold):
    """A notebook with two answers, and the record of what was run."""
    codes = [HEAD, ROOT, NEEDED.format(needed), CHECKS[0], "1 / 0", DIAGNOSIS.format(threshold), CHECKS[1]]
    write_notebook(folder / "08_convergence.ipynb", *codes)
    names = {}
    exec("\n".join(code.replace("%matplotlib inline", "") for code in codes if code != "1 / 0"), names)
    return report(folder.name, folder)


@pytest.fixture(autouse=True)
def no_records(monkeypatch):
    monkeypatch.setattr(verdict, "RECORDS", {})
    monkeypatch.setattr("meshot_book.exercises.reports.RECORDS", verdict.RECORDS)


def test_three_notebooks_with_known_answers(tmp_path, capsys):
    hand_in(tmp_path / "ada", RIGHT, 1)
    hand_in(tmp_path / "ben", "root(p, joint, first + second, tolerance) ** 2", 1)
    record = hand_in(tmp_path / "eve", RIGHT, 2)
    record.write_text(record.read_text().replace('"points": 0', '"points": 1'))
    assert marks.main([str(tmp_path)]) == 0
    said = [line.split() for line in capsys.readouterr().out.splitlines()[-5:-1]]
    assert said[0] == ["student", "points", "of", "reported", "remarks"]
    assert said[1] == ["ada", "2", "2", "2"]
    assert said[2] == ["ben", "1", "2", "1"]
    assert said[3] == ["eve", "1", "2", "2", "the", "record", "differs", "in", "diagnosis"]
    rows = (tmp_path / "marks.csv").read_text().splitlines()
    assert len(rows) == 7
    assert rows[3].startswith("ben,08_convergence.ipynb,points_needed,6,")
    assert rows[3].endswith(",0,1,this is no whole number of points: round it up,0")


def test_what_a_cell_defined_before_it_failed_counts_as_in_jupyter(tmp_path, capsys):
    answer = DIAGNOSIS.format(1) + "\n\n\ncheck.diagnosis(diagnosis)"  # check is imported in the next cell
    write_notebook(tmp_path / "40.ipynb", answer, f"{HEAD}\n{CHECKS[1]}")
    write_notebook(tmp_path / "41.ipynb", "1 / 0\n" + answer, f"{HEAD}\n{CHECKS[1]}")
    assert marks.main([str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert [line.split()[:3] for line in out.splitlines()[-3:-1]] == [["40", "1", "1"], ["41", "0", "1"]]
    assert "41.ipynb, diagnosis: a cell that it needs raised ZeroDivisionError: division by zero" in out


def test_a_record_is_a_line_for_the_lecturer_and_grows_from_chapter_to_chapter(tmp_path, capsys):
    EXERCISES["diagnosis"](lambda *_: 3)
    file = report("student-17", tmp_path)
    verdict.RECORDS.clear()
    EXERCISES["points_needed"](lambda *_: 3)
    capsys.readouterr()
    report("student-17", tmp_path)
    line = "student-17,0,2,diagnosis=0,points_needed=0\n"
    assert capsys.readouterr().out == (tmp_path / "student-17.csv").read_text() == line
    first, second = json.loads(file.read_text())["records"]
    assert (first["exercise"], first["cases"], first["passed"], first["points"], first["of"]) == (
        "diagnosis",
        8,
        1,
        0,
        1,
    )
    assert second["hint"].startswith("wrong on 6 of 6 cases")


@pytest.mark.parametrize(
    ("name", "words"), [("a/b", "cannot be the name of a file"), ("", "cannot be"), ("kim", "no checker has run")]
)
def test_what_cannot_be_reported(tmp_path, name, words):
    if name != "kim":
        EXERCISES["diagnosis"](lambda *_: 3)
    with pytest.raises(ValueError, match=words):
        report(name, tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"records": [{"exercise": "a"}]}', "[" * 100_000])
def test_a_record_that_cannot_be_read_is_named(tmp_path, text):
    EXERCISES["diagnosis"](lambda *_: 3)
    (tmp_path / "kim.json").write_text(text)
    with pytest.raises(ValueError, match=r"kim\.json is no record of exercises"):
        report("kim", tmp_path)


def test_one_student_never_stops_the_others(tmp_path, capsys):
    (tmp_path / "broken.ipynb").write_text("{")
    (tmp_path / "deep.ipynb").write_text("[" * 100_000)
    (tmp_path / "ada").mkdir()
    (tmp_path / "ada" / "ada.json").write_text("[]")
    bad = {
        "loop": "while True: pass",
        "leaves": "import os\n    os._exit(0)",
        "exits": "raise SystemExit(3)",
        "stops": "import os, signal\n    os.kill(os.getpid(), signal.SIGSTOP)",
        "patches": "from meshot_book.exercises import check\n    check.diagnosis = lambda f: 1\n    return 3",
    }
    for name, body in bad.items():
        code = f"def diagnosis(*_):\n    {body}"
        write_notebook(tmp_path / name / "40.ipynb", HEAD, code, CHECKS[1])
    write_notebook(tmp_path / "raises" / "40.ipynb", HEAD, "diagnosis = 1 / 0", CHECKS[1])
    write_notebook(tmp_path / "unwritten" / "40.ipynb", HEAD, "def diagnosis(:", CHECKS[1])
    write_notebook(tmp_path / "ada" / "40.ipynb", HEAD, DIAGNOSIS.format(1), CHECKS[1])
    assert marks.main([str(tmp_path), "--seconds", "3"]) == 0
    out = capsys.readouterr().out
    table = {line.split()[0]: line.split()[1:3] for line in out.splitlines() if line.startswith(tuple(bad))}
    assert table == {name: ["0", "1"] for name in bad}
    assert f"{tmp_path / 'broken.ipynb'}: no notebook can be read (JSONDecodeError" in out
    assert f"{tmp_path / 'deep.ipynb'}: no notebook can be read (RecursionError" in out
    assert f"{tmp_path / 'loop' / '40.ipynb'}, diagnosis: it took more than 3 s; the answer was stopped\n" in out
    assert f"{tmp_path / 'stops' / '40.ipynb'}, diagnosis: it took more than 3 s" in out
    assert "leaves/40.ipynb, diagnosis: its process ended before the answer was checked (status 0)\n" in out
    assert "raises/40.ipynb, diagnosis: a cell that it needs raised ZeroDivisionError: division by zero\n" in out
    assert "unwritten/40.ipynb, diagnosis: a cell that it needs raised NameError" in out
    assert re.search(r"^ada +1 +1 +ada.json is no record of exercises$", out, re.M)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["nowhere"], "is no folder"), (["."], "holds no notebooks"), ([".", "--seconds", "0"], "no time limit")],
)
def test_a_folder_that_cannot_be_marked(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert marks.main(arguments) == 2
    assert words in capsys.readouterr().err


def test_only_the_cells_that_an_answer_needs_are_run(tmp_path):
    slow = "import time\ntime.sleep(1000)\nwaited = 1"
    codes = [HEAD, slow, "seen = 5", "one = 1", DIAGNOSIS.format("one"), CHECKS[1] + "\nwaited", "one = 2"]
    write_notebook(tmp_path / "a.ipynb", *codes)
    (answer,) = marks.found_answers(tmp_path / "a.ipynb")
    assert answer.expression == "diagnosis"
    assert answer.cells == ("one = 1", DIAGNOSIS.format("one"))
