"""The list of survivors is current and gives reasons, and a mutant is tried by the tests of its room."""

import tomllib
from pathlib import Path

import mutants
import pytest
import try_mutant


def test_the_list_is_current(root):
    assert mutants.stale(mutants.known_survivors(), root) == []


def test_an_entry_whose_line_has_gone_is_seen(tmp_path):
    (tmp_path / "a.py").write_text("    x = 1\n")
    known = {("a.py", "x = 1", "x = 3"): "why", ("a.py", "x = 2", "x = 3"): "why", ("b.py", "x = 1", "x = 3"): "why"}
    assert mutants.stale(known, tmp_path) == [("a.py", "x = 2", "x = 3"), ("b.py", "x = 1", "x = 3")]


def test_an_entry_without_a_reason_is_refused(tmp_path):
    (tmp_path / "s.yaml").write_text("- {file: a.py, text: x = 1, change: x = 2, why: ''}\n")
    with pytest.raises(ValueError, match="gives no reason"):
        mutants.known_survivors(tmp_path / "s.yaml")


def test_what_is_mutated_is_there(root):
    configuration = tomllib.loads((root / "tests/mutation/cosmic-ray.toml").read_text(encoding="utf-8"))["cosmic-ray"]
    assert len(configuration["module-path"]) == 6
    assert all((root / path).is_dir() for path in configuration["module-path"])
    assert (root / configuration["test-command"].split()[1]).is_file()
    assert all((root / "tests" / name).exists() for names in try_mutant.MORE.values() for name in names)


@pytest.fixture
def two_checkouts(tmp_path):
    """A checkout and its copy, each with two rooms and their tests."""
    for copy in ("original", "copy"):
        for room in ("loss", "mesh"):
            for place, name in (("src/meshot", "slicing.py"), ("tests", "test_all.py"), ("tests", "test_slicing.py")):
                (tmp_path / copy / place / room).mkdir(parents=True, exist_ok=True)
                (tmp_path / copy / place / room / name).write_text("def sliced():\n    return 1\n")
    return tmp_path / "copy", tmp_path / "original"


def test_the_file_of_a_mutant_is_found(two_checkouts):
    copy, original = two_checkouts
    assert try_mutant.changed_files(copy, original) == []
    (copy / "src/meshot/loss/slicing.py").write_text("def sliced():\n    return 2\n")
    assert try_mutant.changed_files(copy, original) == [Path("loss/slicing.py")]


def test_a_mutant_is_tried_by_the_nearest_tests_first(two_checkouts):
    _, original = two_checkouts
    tests = try_mutant.tests_of(Path("loss/slicing.py"), original)
    assert tests == [Path("loss/test_slicing.py"), Path("loss/test_all.py")]


def test_every_room_that_is_mutated_has_tests(root):
    assert try_mutant.tests_of(Path("metrics/distances.py"), root)[0] == Path("metrics/test_distances.py")
    assert Path("loss/test_values.py") in try_mutant.tests_of(Path("measure/discrete.py"), root)
    assert Path("metrics/test_table.py") in try_mutant.tests_of(Path("mesh/geometry.py"), root)


def test_the_other_tests_of_a_room_are_run_when_the_nearest_pass(two_checkouts, monkeypatch):
    copy, original = two_checkouts
    (copy / "src/meshot/loss/slicing.py").write_text("def sliced():\n    return 2\n")
    (copy / "tests/loss/test_slicing.py").write_text("def test_near():\n    pass\n")
    (copy / "tests/loss/test_all.py").write_text("def test_far():\n    assert False\n")
    monkeypatch.chdir(copy)
    monkeypatch.setenv("MESHOT_ORIGINAL", str(original))
    monkeypatch.setattr(try_mutant, "N_NEAREST", 1)
    assert try_mutant.main() == 1
    (copy / "tests/loss/test_all.py").write_text("def test_far():\n    pass\n")
    assert try_mutant.main() == 0
