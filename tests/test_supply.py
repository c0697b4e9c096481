"""What the project stands on is listed with its licences, counted in a bill, and looked up where that can be done."""

import importlib.metadata
import json
from email.message import Message
from types import SimpleNamespace

import pytest

import audit
import licences
import sbom


def test_the_table_is_current():
    assert licences.main(["--check"]) == 0


def test_every_installed_package_states_a_licence():
    rows = licences.rows_of(licences.TABLE.read_text(encoding="utf-8"))
    unknown = (licences.UNSTATED, licences.NOT_HERE)
    assert [name for name, row in rows.items() if row[3] == "always" and row[2] in unknown] == []


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [("numpy==", "numpy==9.", ["numpy"]), ("tqdm==", "tkdm==", ["tkdm", "tqdm"])],
)
def test_a_table_that_is_not_current_is_seen(old, new, expected):
    lock, table = licences.LOCK.read_text(encoding="utf-8"), licences.TABLE.read_text(encoding="utf-8")
    changed = licences.table_of(lock.replace(f"\n{old}", f"\n{new}"), table)
    assert licences.differences(table, changed) == expected


METADATA = [
    ({"License-Expression": "MIT", "Classifier": "License :: OSI Approved :: BSD License"}, "MIT"),
    ({"License": "BSD-3-Clause", "Classifier": "License :: OSI Approved :: BSD License"}, "BSD License"),
    ({"License": "Apache 2.0\nmore"}, "Apache 2.0"),
    ({"License": "x" * 100}, "not stated"),
    ({"License": "UNKNOWN"}, "not stated"),
    ({}, "not stated"),
]


@pytest.mark.parametrize(("fields", "expected"), METADATA)
def test_a_licence_is_a_few_words(fields, expected):
    message = Message()
    for name, value in fields.items():
        message[name] = value
    assert licences.licence_of(message) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [("MIT License\n\nCopyright", "MIT License"), ("Copyright", "not stated"), (None, "not stated")],
)
def test_a_licence_that_only_a_file_states(text, expected):
    message = Message()
    message["License-File"] = "LICENSE"
    package = SimpleNamespace(metadata=message, read_text=lambda name: text)
    assert licences.licence_file_of(package) == expected


def test_what_is_not_installed_keeps_its_line(monkeypatch):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", missing)
    table = licences.HEAD + "| appnope | 1 | BSD | always |\n"
    assert "| appnope | 2 | BSD |" in licences.table_of("appnope==2\n", table)
    assert licences.NOT_HERE in licences.table_of("other==2\n", table)


def test_the_bill_names_every_package_and_repeats():
    lock, table = licences.LOCK.read_text(encoding="utf-8"), licences.TABLE.read_text(encoding="utf-8")
    bill = sbom.bill_of(lock, table)
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    assert len(bill["components"]) == len(lock.splitlines()) > 150
    references = [part["bom-ref"] for part in bill["components"]]
    assert len(set(references)) == len(references)
    assert "pkg:pypi/numpy@2" in " ".join(references)
    assert bill == sbom.bill_of(lock, table)
    longer = sbom.bill_of(lock + "more==1\n", table + "| more | 1 | MIT | always |\n")
    assert bill["serialNumber"] != longer["serialNumber"]


def test_the_bill_is_written(tmp_path, capsys):
    sbom.main(str(tmp_path / "new" / "sbom.json"))
    assert json.loads((tmp_path / "new" / "sbom.json").read_text(encoding="utf-8"))["version"] == 1


SAFE = json.dumps({"dependencies": [{"name": "a", "version": "1", "vulns": []}]})
BAD = json.dumps({"dependencies": [{"name": "a", "version": "1", "vulns": [{"id": "CVE-1", "fix_versions": ["2"]}]}]})


@pytest.mark.parametrize(
    ("printed", "complaint", "status", "said"),
    [
        (SAFE, "", 0, "no vulnerability is known"),
        (BAD, "", 1, "a 1: CVE-1, mended in 2"),
        ("", "ERROR: Could not connect", 2, "could not be asked\n  ERROR: Could not connect"),
        ("", "No module named pip_audit", 2, "No module named pip_audit"),
        ('{"dependencies": []}', "", 2, "nothing is known"),
    ],
)
def test_an_audit_says_what_it_found_or_that_nothing_is_known(monkeypatch, capsys, printed, complaint, status, said):
    asked = SimpleNamespace(stdout=printed, stderr=complaint)
    monkeypatch.setattr(audit.subprocess, "run", lambda *a, **k: asked)
    assert audit.main() == status
    assert said in capsys.readouterr().out
