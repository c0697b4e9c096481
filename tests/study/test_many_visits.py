"""Studies: whole visits or none, second starts, failures that stay alone, and the table."""

import json
import os
import shutil

import nibabel
import numpy as np
import pytest

from bids_trials import DeadlyVisit, add_scan, network_words
from meshot.cli import main
from meshot.study import many_visits, many_visits as one_visit
from meshot.study.bids import Visit, visits_of_bids
from meshot.study.many_visits import reconstruct_study, write_table
from meshot.study.quality import read_subjects
from refusals import refuses


def statuses(study):
    return {(row["participant_id"], row["session_id"]): row["status"] for row in read_subjects(study)}


def states(study):
    return {p: p.stat().st_mtime_ns for p in study.rglob("*") if p.is_file() and p.name.startswith("lh.")}


EXPECTED = {
    ("sub-01", "ses-a"): "done", ("sub-01", "ses-b"): "done", ("sub-02", None): "done", ("sub-03", None): "failed",
}  # fmt: skip
PAGES = {
    "flat": "sub-01_ses-a/report.html",
    "freesurfer": "sub-01_ses-a/report/report.html",
    "bids": "sub-01/ses-a/report/report.html",
}


@pytest.mark.parametrize("layout", ["flat", "bids", pytest.param("freesurfer", marks=pytest.mark.thorough)])
def test_a_failure_stays_alone_and_a_second_start_does_what_is_missing(
    tmp_path, dataset, settings, quick, turned_scan, layout
):
    study, chosen, lines = tmp_path / "study", one_visit.dataclasses.replace(settings, layout=layout), []
    failed = reconstruct_study(visits_of_bids(dataset), study, chosen, dataset=dataset, tell=lines.append)
    assert [visit.label for visit in failed] == ["sub-03"]
    assert statuses(study) == EXPECTED
    rows = {row["participant_id"]: row for row in read_subjects(study)}
    reason = rows["sub-03"]["error"]
    assert "(cut short or damaged: " in reason
    assert reason.count("sub-03_T1w.nii.gz") == reason.count("get the file again") == 1
    assert next(line for line in lines if "failed" in line).startswith("sub-03: failed: ")
    assert not list(study.rglob("sub-03*/*"))
    assert not list(study.rglob(".writing*"))
    assert read_subjects(study)[0]["report"] == PAGES[layout]
    assert all((study / row["report"]).is_file() for row in rows.values() if row["status"] == "done")
    assert rows["sub-02"]["left_white_euler"] == 2
    assert 0 < rows["sub-02"]["left_white_area_mm2"] < 4 * np.pi * 34**2
    before = states(study)
    shutil.copy(turned_scan, dataset / "sub-03" / "anat" / "sub-03_T1w.nii.gz")
    assert reconstruct_study(visits_of_bids(dataset), study, chosen, dataset=dataset, tell=lines.append) == []
    assert set(statuses(study).values()) == {"done"}
    earlier = [f"{label}: done by an earlier run" for label in ("sub-01_ses-a", "sub-01_ses-b", "sub-02")]
    assert sorted(lines[-4:])[:3] == earlier
    assert sorted(lines[-4:])[3].startswith("sub-03: done, with warnings: group_average")
    log = (study / "logs" / "meshot.log").read_text(encoding="utf-8")
    assert log.count("registration") == 4
    assert {path: time for path, time in states(study).items() if path in before} == before
    assert [path.name for path in (study / "logs").iterdir()] == ["meshot.log"]


def test_the_report_says_what_was_used(tmp_path, dataset, settings, quick, turned_scan):
    add_scan(dataset, "sub-02_run-1_T1w.nii.gz", turned_scan)
    (dataset / "sub-02" / "anat" / "sub-02_T1w.nii.gz").rename(dataset / "sub-02" / "anat" / "sub-02_run-2_T1w.nii.gz")
    (visit,) = [visit for visit in visits_of_bids(dataset) if visit.participant == "02"]
    report = one_visit.reconstruct_visit(visit, tmp_path / "study", settings)
    assert list(report["scans"]) == ["sub-02_run-1_T1w.nii.gz", "sub-02_run-2_T1w.nii.gz"]
    assert report["notes"] == list(visit.notes)
    assert "hold the same scan; it is used once" in report["warnings"][0]
    assert report["warning_names"][:2] == ["same_file_twice", "group_average"]
    assert (tmp_path / "study" / "sub-02" / "scan.nii.gz").is_file()


def test_other_scans_are_not_taken_for_those_that_were_done(tmp_path, dataset, settings, quick):
    visit = visits_of_bids(dataset)[0]
    one_visit.reconstruct_visit(visit, tmp_path / "study", settings)
    image = nibabel.load(visit.scans[0])
    nibabel.save(nibabel.Nifti1Image(np.asarray(image.dataobj) * 2, image.affine), visit.scans[0])
    refuses("made before with another scans", one_visit.reconstruct_visit, visit, tmp_path / "study", settings)
    again = one_visit.dataclasses.replace(settings, overwrite=True)
    report = one_visit.reconstruct_visit(visit, tmp_path / "study", again)
    assert one_visit.reconstruct_visit(visit, tmp_path / "study", settings)["scans"] == report["scans"]


@pytest.mark.parametrize("same", [True, False])
def test_of_two_runs_of_one_visit_the_first_to_end_is_taken(tmp_path, dataset, settings, quick, monkeypatch, same):
    visit, write = visits_of_bids(dataset)[0], one_visit.write_found

    def overtaken(*arguments):
        monkeypatch.setattr(one_visit, "write_found", write)
        other = one_visit.reconstruct_visit(visit, tmp_path / "study", settings)
        if not same:
            (tmp_path / "study" / visit.label / "report.json").write_text(json.dumps(other | {"scans": {"a": "b"}}))
        return write(*arguments)

    monkeypatch.setattr(one_visit, "write_found", overtaken)
    if same:
        report = one_visit.reconstruct_visit(visit, tmp_path / "study", settings)
        assert report == json.loads((tmp_path / "study" / visit.label / "report.json").read_text(encoding="utf-8"))
    else:
        refuses("made before with another scans", one_visit.reconstruct_visit, visit, tmp_path / "study", settings)
    assert not list((tmp_path / "study").rglob(".writing*"))


def test_a_folder_with_other_things_is_kept(tmp_path, dataset, settings, quick):
    precious = tmp_path / "study" / "sub-02" / "thesis.txt"
    precious.parent.mkdir(parents=True)
    precious.write_text("years")
    (visit,) = [visit for visit in visits_of_bids(dataset) if visit.participant == "02"]
    again = one_visit.dataclasses.replace(settings, overwrite=True)
    refuses("holds something else", one_visit.reconstruct_visit, visit, tmp_path / "study", again)
    assert precious.read_text(encoding="utf-8") == "years"


def test_a_group_average_is_seen_and_strict_refuses_it(tmp_path, dataset, settings, quick):
    visit = visits_of_bids(dataset)[0]
    strict = one_visit.dataclasses.replace(settings, strict=True)
    with pytest.raises(ValueError, match=r"is it a group average\?.*\(group_average\)\. Without --strict"):
        one_visit.reconstruct_visit(visit, tmp_path / "study", strict)
    assert not (tmp_path / "study").exists()
    report = one_visit.reconstruct_visit(visit, tmp_path / "study", settings)
    assert report["warning_names"][0] == "group_average"
    refuses("Without --strict", one_visit.reconstruct_visit, visit, tmp_path / "study", strict)


def test_nothing_is_left_of_a_visit_that_fails_at_the_end(tmp_path, dataset, settings, quick, monkeypatch):
    def fail(*_):
        raise MemoryError("no room")

    monkeypatch.setattr(one_visit, "write_found", fail)
    visits = [visit for visit in visits_of_bids(dataset) if visit.participant == "02"]
    assert reconstruct_study(visits, tmp_path / "study", settings, tell=lambda line: None) == visits
    assert not (tmp_path / "study" / "sub-02").exists()
    assert "MemoryError: no room" in read_subjects(tmp_path / "study")[0]["error"]


def test_a_doubt_about_the_scan_stands_beside_the_reason_of_a_failure(tmp_path, dataset, settings):
    """A T2 that is called T1w fails somewhere; the echo time in its sidecar says why."""
    (dataset / "sub-03" / "anat" / "sub-03_T1w.json").write_text('{"EchoTime": 0.35}')
    visits = [visit for visit in visits_of_bids(dataset) if visit.participant == "03"]
    assert reconstruct_study(visits, tmp_path / "study", settings, tell=lambda line: None) == visits
    error = read_subjects(tmp_path / "study")[0]["error"]
    assert error.startswith(str(dataset))
    assert "; get the file again (Warning: sub-03_T1w.nii.gz was taken with an echo time of 350 ms; a T1 has" in error
    assert error.endswith("is it a T2?)")


def test_a_scan_without_permission_is_named(tmp_path, dataset, settings, monkeypatch):
    visit, access = visits_of_bids(dataset)[0], os.access
    monkeypatch.setattr(os, "access", lambda path, *more: path != visit.scans[0] and access(path, *more))
    with pytest.raises(ValueError, match=r"ses-a_T1w.nii.gz cannot be read \(Permission denied\); give yourself"):
        one_visit.reconstruct_visit(visit, tmp_path / "study", settings)


@pytest.mark.thorough
def test_a_process_that_is_killed_takes_only_its_own_visit(tmp_path, settings):
    """In two processes, one of which is ended from outside; the other visits fail for reasons of their own."""
    visits = [DeadlyVisit("01", trouble="deadly"), *(Visit(f"0{i}", trouble=f"trouble {i}") for i in (2, 3))]
    failed = reconstruct_study(visits, tmp_path / "study", settings, jobs=2, tell=lambda line: None)
    assert len(failed) == 3
    errors = [row["error"] for row in read_subjects(tmp_path / "study")]
    assert errors[0].startswith("its process was ended from outside")
    assert errors[1:] == ["trouble 2", "trouble 3"]


def test_bad_places_and_numbers(tmp_path, dataset, settings):
    visits = visits_of_bids(dataset)
    refuses("is the data set itself", reconstruct_study, visits, dataset, settings, dataset=dataset)
    (tmp_path / "file").write_text("in the way")
    refuses("cannot be written to", reconstruct_study, visits, tmp_path / "file", settings)
    refuses("no visit", reconstruct_study, [], tmp_path / "study", settings)
    refuses("jobs is 0", reconstruct_study, visits, tmp_path / "study", settings, jobs=0)


def test_without_permission_the_folder_is_named(tmp_path, dataset, settings, monkeypatch):
    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(many_visits.tempfile, "TemporaryFile", refuse)
    with pytest.raises(ValueError, match=r"cannot be written to \(Permission denied\); choose another folder"):
        reconstruct_study(visits_of_bids(dataset), tmp_path / "study", settings)


def test_a_report_that_is_none_is_named_before_the_first_visit(tmp_path, settings):
    (tmp_path / "sub-01").mkdir()
    (tmp_path / "sub-01" / "report.json").write_text("{}")
    refuses("is no record of a visit", write_table, tmp_path)
    with pytest.raises(ValueError, match="is no record of a visit"):
        reconstruct_study([Visit("02", trouble="none")], tmp_path, settings, tell=lambda line: pytest.fail(line))


def test_the_command_line_of_bids_apps(tmp_path, dataset, settings, quick, capsys):
    (dataset / "participants.tsv").write_text("participant_id\nsub-01\nsub-77\n")
    words = [
        "reconstruct",
        str(dataset),
        str(tmp_path / "out"),
        "participant",
        *network_words(settings),
        "--layout",
        "bids",
    ]
    assert main([*words, "--participant-label", "01", "--session-label", "b"]) == 0
    said = capsys.readouterr()
    assert "1 done, 0 failed" in said.out
    assert "sub-77 is in participants.tsv, but has no folder" in said.err
    assert list(statuses(tmp_path / "out")) == [("sub-01", "ses-b")]
    assert main(words) == 1
    assert "3 done, 1 failed" in capsys.readouterr().out
    assert statuses(tmp_path / "out") == EXPECTED
    (tmp_path / "out" / "subjects.tsv").unlink()
    assert main(["reconstruct", str(dataset), str(tmp_path / "out"), "group"]) == 0
    assert statuses(tmp_path / "out") == EXPECTED


def test_files_and_folders_of_scans_make_a_study(tmp_path, settings, quick, turned_scan, capsys):
    folder = tmp_path / "scans"
    folder.mkdir()
    for name in ("one.nii.gz", "two.nii.gz"):
        shutil.copy(turned_scan, folder / name)
    assert main(["reconstruct", str(folder), "-o", str(tmp_path / "a"), *network_words(settings)]) == 0
    files = [str(folder / "one.nii.gz"), str(folder / "two.nii.gz")]
    assert (
        main(["reconstruct", *files, "-o", str(tmp_path / "b"), *network_words(settings), "--layout", "freesurfer"])
        == 0
    )
    for study in ("a", "b"):
        assert list(statuses(tmp_path / study)) == [("sub-one", None), ("sub-two", None)]
    log = (tmp_path / "b" / "sub-one" / "scripts" / "meshot.log").read_text(encoding="utf-8")
    assert "registration: " in log
    assert "warning: the scan is like the average" in log


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["a.nii"], "there is no folder for the results"),
        (["a.nii", "-o", "x", "--derivatives", "d"], "--derivatives does not go with a single scan"),
        (["a.nii", "b.nii", "-o", "x", "--run", "1"], "--run does not go with scans that are no BIDS"),
        (["a.nii", "b.nii", "-o", "x", "--brain-mask", "m"], "--brain-mask does not go with a study"),
        (["a.nii", "b.nii", "-o", "x"], "a.nii does not exist"),
        (["nowhere", "x", "participant"], "nowhere is no folder"),
    ],
)
def test_bad_words_end_in_one_line(tmp_path, monkeypatch, capsys, settings, words, why):
    monkeypatch.chdir(tmp_path)
    assert main(["reconstruct", *words, *network_words(settings)]) == 2
    said = capsys.readouterr()
    assert why in said.err
    assert said.out == ""
    assert list(tmp_path.iterdir()) == []


def test_the_data_of_a_failure_are_kept_as_json(tmp_path, settings):
    reconstruct_study([Visit("01", "b", trouble="no <scan>")], tmp_path, settings, tell=lambda line: None)
    record = json.loads((tmp_path / "logs" / "sub-01_ses-b_error.json").read_text(encoding="utf-8"))
    assert record == {"participant_id": "sub-01", "session_id": "ses-b", "error": "no <scan>", "scans": ""}
