"""Results files are whole, finite, and say where they come from; numbers print alike everywhere."""

import json
import math
import platform
import re
import socket
import subprocess

import pytest
import torch

from meshot import provenance
from meshot.provenance import (
    FIELDS,
    PACKAGE,
    commit_of,
    package_version,
    provenance_lines,
    read_results,
    rounded,
    write_results,
)
from meshot_book.notebook.environment import environment_card
from meshot_book.notebook.tables import digits


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "results.json"
    write_results(path, {"w2": [0.1, 0.2]}, {"seed": 3}, "python experiments/x/run.py", "synthetic", 12.34)
    return path


def test_results_come_back_with_provenance(written):
    record = read_results(written)
    assert record["results"] == {"w2": [0.1, 0.2]}
    assert set(record) == {*FIELDS, "processor"}
    lines = provenance_lines(record)
    assert f"({record['processor']})" in lines
    assert "python experiments/x/run.py" in lines
    assert f"torch {record['versions']['torch']}" in lines


@pytest.fixture
def checkout(tmp_path):
    for name in ("src/meshot/loss/sliced.py", "src/meshot_book/claims/ledger.py", "experiments/ddot/small.yaml",
                 "experiments/ddot/results.json"):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("as committed\n")
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "mark"),
    [
        ("src/meshot/loss/sliced.py", "+changes"),
        ("src/meshot_book/claims/ledger.py", "+changes"),
        ("experiments/ddot/small.yaml", "+changes"),
        ("experiments/ddot/results.json", ""),
    ],
)
def test_changes_of_code_and_settings_mark_the_commit(checkout, name, mark):
    clean = commit_of(checkout / "src/meshot")
    assert len(clean) == 12
    (checkout / name).write_text("not committed\n")
    assert commit_of(checkout / "src/meshot") == clean + mark


def test_the_package_is_what_is_looked_at(tmp_path):
    assert PACKAGE.name == "meshot"
    assert (PACKAGE / "loss").is_dir()
    assert commit_of(tmp_path) == "not in a git checkout"


CPU_INFO = "processor\t: 0\nmodel name\t: Imagined 9000 CPU @ 1 GHz\n\nprocessor\t: 1\nmodel name\t: Another\n"


def test_a_processor_has_a_model_and_instructions(tmp_path, monkeypatch):
    instructions = torch.backends.cpu.get_cpu_capability()
    monkeypatch.setattr(provenance, "CPU_INFO", tmp_path / "cpuinfo")
    monkeypatch.setattr(platform, "processor", lambda: "arm")
    assert provenance.processor() == f"arm, {instructions}"
    (tmp_path / "cpuinfo").write_text(CPU_INFO)
    assert provenance.processor() == f"Imagined 9000 CPU @ 1 GHz, {instructions}"
    # Some processors are named by numbers alone.
    (tmp_path / "cpuinfo").write_text("processor\t: 0\nCPU part\t: 0xd0c\n")
    assert provenance.processor() == f"arm, {instructions}"


def test_no_record_names_its_machine(monkeypatch):
    host = "somebodys-machine"
    monkeypatch.setattr(platform, "node", lambda: host)
    monkeypatch.setattr(socket, "gethostname", lambda: host)
    assert host not in json.dumps(provenance.provenance())


def test_records_from_before_the_processor_was_noted_are_read(written):
    old = json.loads(written.read_text(encoding="utf-8"))
    del old["processor"]
    written.write_text(json.dumps(old))
    assert provenance_lines(read_results(written)).splitlines()[3] == f"took      12.3 s on {old['machine']}"


def test_results_are_rounded_wherever_they_are():
    assert rounded({"a": [1 / 3, {"b": 2e9 / 3}], "n": 12345678, "c": True, "d": None, "e": "1.23456789"}) == {
        "a": [0.333333, {"b": 666667000.0}], "n": 12345678, "c": True, "d": None, "e": "1.23456789"
    }  # fmt: skip


def test_bad_results_are_refused(tmp_path, written):
    with pytest.raises(ValueError, match="does not exist"):
        read_results(tmp_path / "none.json")
    half = tmp_path / "half.json"
    half.write_text(written.read_text(encoding="utf-8")[:-40], encoding="utf-8")
    with pytest.raises(ValueError, match="not whole JSON"):
        read_results(half)
    poor = tmp_path / "poor.json"
    poor.write_text(json.dumps({"results": {}}))
    with pytest.raises(ValueError, match="lacks config, command"):
        read_results(poor)
    with pytest.raises(ValueError, match="as JSON"):
        write_results(written, {"w2": math.nan}, {}, "", "", 0.0)
    assert read_results(written)["results"] == {"w2": [0.1, 0.2]}


@pytest.mark.parametrize(
    ("value", "text"),
    [(math.pi, "3.142"), (-0.0, "0"), (1234567.0, "1.235e+06"), (2.0, "2"), (1e-9, "1e-09"), (math.inf, "inf")],
)
def test_four_digits(value, text):
    assert digits(value) == text


def test_the_card_names_what_ran():
    card = environment_card(0.0, 7)
    assert "seed 7" in card
    assert f"torch {package_version('torch')}" in card
    assert package_version("no-such-package") == "not installed"


@pytest.mark.parametrize("content", [b"3", b"[]", b"null", b"\xff\xfe", b"[" * 100_000, b"1" * 5000])
def test_files_that_hold_no_record(tmp_path, content):
    (tmp_path / "r.json").write_bytes(content)
    with pytest.raises(ValueError, match=r"is not whole JSON|lacks results"):
        read_results(tmp_path / "r.json")


def test_the_page_of_experiments_says_how_long_each_took(root):
    """To two digits, or to one below two minutes."""
    text = (root / "experiments" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(.+?)` \| .+? \| ([^|]+) \| [^|]+ \|$", text, re.M)
    assert len(rows) > 30
    for name, said in rows:
        file = root / "experiments" / name / "results.json"
        if not file.is_file():
            assert said == "—", name
            continue
        number, unit = said.split()
        seconds = float(number) * {"s": 1, "min": 60, "h": 3600}[unit]
        assert seconds == pytest.approx(read_results(file)["seconds"], rel=0.2), name
