"""The list of survivors is current and gives reasons, and a mutant is tried by the tests of its room."""

import tomllib

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
    configuration = tomllib.loads((root / "tests/mutation/cosmic-ray.toml").read_text())["cosmic-ray"]
    assert len(configuration["module-path"]) == 6
    assert all((root / path).is_dir() for path in configuration["module-path"])
    assert (root / configuration["test-command"].split()[1]).is_file()
    assert all((root / "tests" / name).exists() for names in try_mutant.MORE.values() for name in names)


def test_the_room_of_a_mutant_is_found(tmp_path):
    for copy in ("original", "copy"):
        for room in ("loss", "mesh"):
            (tmp_path / copy / "src/meshot" / room).mkdir(parents=True)
            (tmp_path / copy / "src/meshot" / room / "a.py").write_text("x = 1\n")
    assert try_mutant.changed_rooms(tmp_path / "copy", tmp_path / "original") == set()
    (tmp_path / "copy/src/meshot/loss/a.py").write_text("x = 2\n")
    assert try_mutant.changed_rooms(tmp_path / "copy", tmp_path / "original") == {"loss"}
