"""The table of a study: what is written is read, and what is no such table is refused."""

import csv
import json
from pathlib import Path

import pytest

from meshot.cli import main
from meshot.study import quality as subjects_table
from meshot.study.quality import (
    DICTIONARY,
    TABLE,
    columns,
    numbers_of_report,
    read_subjects,
    row_of_report,
    write_quality_page,
    write_subjects,
)
from refusals import refuses

NUMBERS = {
    "final": {
        "n_vertices": 12, "n_faces": 20, "euler_number": 2, "n_self_intersecting_faces": 0, "volume_cm3": 250.5,
        "area_cm2": 900.25,
    },
    "pial": {"area_cm2": 1100.5, "mean_thickness_mm": 2.5, "cortex_volume_cm3": 240.0},
    "distance_from_initial_mm": {"mean": 0.5},
    "n_voxels_given_up": 7,
}  # fmt: skip
REPORT = {
    "surfaces": {"left": NUMBERS, "right": NUMBERS},
    "seconds": {"clock": {"one": 1.25, "two": 2.5}},
    "warnings": ["it looks odd"],
}


def test_the_numbers_of_a_report_have_units_of_mm():
    row = numbers_of_report(REPORT)
    assert row["left_white_area_mm2"] == 90025
    assert row["right_white_volume_mm3"] == 250500
    assert (row["left_pial_area_mm2"], row["right_thickness_mm"], row["left_cortex_volume_mm3"]) == (
        110050,
        2.5,
        240000,
    )
    assert (row["left_white_euler"], row["left_white_voxels_given_up"]) == (2, 7)
    assert (row["seconds"], row["warnings"]) == (3.75, 1)
    assert set(row) <= set(columns())
    doubted = REPORT | {"warning_names": [], "doubts": {"left": {"frontal": ["cut", "shape"]}}}
    made = row_of_report(Path("study"), Path("study/sub-01/report.json"), doubted)
    assert made["doubts"] == "left frontal (cut, shape)"
    white_only = numbers_of_report(REPORT | {"surfaces": dict.fromkeys(("left", "right"), NUMBERS | {"pial": None})})
    assert [white_only[f"left_{name}"] for name in ("pial_area_mm2", "thickness_mm", "cortex_volume_mm3")] == [None] * 3
    assert white_only["left_white_area_mm2"] == 90025


@pytest.mark.parametrize("place", [".", "report"])
def test_the_folder_of_one_scan_has_a_page(tmp_path, place, capsys):
    folder = tmp_path / "one scan"
    (folder / place).mkdir(parents=True)
    (folder / place / "report.html").write_text("<title>report</title>")
    (folder / place / "report.json").write_text(json.dumps(REPORT | {"warning_names": ["odd_name"]}))
    assert main(["quality", str(folder)]) == 0
    page = (folder / "quality.html").read_text()
    for words in ("one scan", "1 rows: 0 failed, 1 with warnings", "warnings: odd_name", "report.html", "90"):
        assert words in page
    (folder / place / "report.json").write_text("{}")
    refuses("report.json is no record of a reconstruction .it lacks 'warning_names'", write_quality_page, folder)
    write_subjects(folder, [{"participant_id": "sub-07", "status": "done"}])  # a study has its table
    assert "sub-07" in write_quality_page(folder).read_text()


def test_what_is_written_is_read_in_order(tmp_path):
    rows = [
        {"participant_id": "sub-02", "status": "failed", "error": "no\tgood\nat all"},
        {"participant_id": "sub-01", "session_id": "ses-02", "status": "done"} | numbers_of_report(REPORT),
        {"participant_id": "sub-01", "session_id": "ses-01", "status": "done"},
    ]
    write_subjects(tmp_path, rows)
    found = read_subjects(tmp_path)
    assert [(r["participant_id"], r["session_id"]) for r in found] == [
        ("sub-01", "ses-01"), ("sub-01", "ses-02"), ("sub-02", None),
    ]  # fmt: skip
    assert found[1]["left_white_area_mm2"] == 90025.0
    assert found[2]["error"] == "no good at all"
    assert found[0]["seconds"] is None
    with (tmp_path / TABLE).open(encoding="utf-8") as file:
        head = next(csv.reader(file, dialect="excel-tab"))
    described = json.loads((tmp_path / DICTIONARY).read_text(encoding="utf-8"))
    assert head == list(described) == columns()
    assert head[:3] == ["participant_id", "session_id", "status"]
    assert all(entry["Description"] for entry in described.values())


def test_an_unknown_column_is_refused(tmp_path):
    refuses("the columns mood", write_subjects, tmp_path, [{"participant_id": "sub-01", "mood": "fine"}])
    assert not (tmp_path / TABLE).exists()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "does not exist"),
        (b"", "no table"),
        (b"participant_id\n\xff\n", "no table"),
        (b"name\tage\nx\t3\n", "starts with the column"),
        (b"participant_id\tstatus\nsub-01\n", "line 2"),
        (b"participant_id\tseconds\nsub-01\tlong\n", "'long' in the column seconds"),
    ],
)
def test_what_is_no_table_of_a_study_is_refused(tmp_path, text, why):
    if text is not None:
        (tmp_path / TABLE).write_bytes(text)
    refuses(why, subjects_table.read_subjects, tmp_path)
