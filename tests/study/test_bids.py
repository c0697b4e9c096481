"""BIDS in: which scans are found, what is ignored, and what is said about data sets that are not whole."""

import json
import os
from pathlib import Path

import pytest

from meshot.study.bids import Choice, missing_participants, sidecar_of, visits_of_bids
from refusals import refuses


@pytest.fixture
def dataset(tmp_path):
    (tmp_path / "dataset_description.json").write_text('{"Name": "x", "BIDSVersion": "1.10.0"}')
    return tmp_path


def add(dataset, *names, text=""):
    for name in names:
        parts = [part for part in name.split("_") if part.startswith(("sub-", "ses-"))]
        path = dataset.joinpath(*parts, "anat", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def only(dataset, **choice):
    (visit,) = visits_of_bids(dataset, Choice(**choice))
    return visit


def test_scans_are_found_by_the_rules_of_bids(dataset):
    add(
        dataset, "sub-02_T1w.nii", "sub-01_ses-b_acq-x_T1w.nii.gz", "sub-01_ses-a_T1w.nii.gz",
        "sub-01_ses-a_T2w.nii.gz", "sub-01_ses-a_T1w.json", "sub-01_ses-a_desc-brain_T1w.nii.gz",
        "sub-01_ses-a_run-x_T1w.nii.gz",
    )  # fmt: skip
    add(dataset, "sub-02_part-phase_T1w.nii", "sub-01_ses-c_T2w.nii.gz")
    (dataset / "sub-01" / "ses-a" / "anat" / "sub-01_ses-a_T1w.json").write_text("{}")
    (dataset / "derivatives" / "sub-09" / "anat").mkdir(parents=True)
    found = visits_of_bids(dataset)
    assert [visit.prefix for visit in found] == ["sub-01_ses-a", "sub-01_ses-b_acq-x", "sub-02"]
    assert [[path.name for path in visit.scans] for visit in found] == [
        ["sub-01_ses-a_T1w.nii.gz"], ["sub-01_ses-b_acq-x_T1w.nii.gz"], ["sub-02_T1w.nii"],
    ]  # fmt: skip
    assert all(visit.trouble is None and visit.warnings == () for visit in found)


def test_participants_and_sessions_are_chosen_by_label(dataset):
    add(dataset, *(f"sub-0{i}_ses-{s}_T1w.nii" for i in (1, 2, 3) for s in "ab"))
    found = visits_of_bids(dataset, Choice(("sub-03", "01"), ("b",)))
    assert [visit.label for visit in found] == ["sub-01_ses-b", "sub-03_ses-b"]
    refuses("there is no sub-7 in the data set; it has 01, 02, 03", visits_of_bids, dataset, Choice(("7",)))
    refuses("there is no ses-c in the data set; it has a, b", visits_of_bids, dataset, Choice(sessions=("c",)))


def test_bidsignore_follows_gitignore(dataset):
    add(dataset, "sub-01_T1w.nii", "sub-01_acq-bad_T1w.nii", "sub-02_T1w.nii", "sub-03_T1w.nii")
    (dataset / ".bidsignore").write_text("# a comment\n\nsub-02/\n**/*acq-bad*\nsub-0[3]\n!sub-03\n")
    assert [visit.prefix for visit in visits_of_bids(dataset)] == ["sub-01", "sub-03"]


def test_runs_are_averaged_or_one_is_chosen_and_this_is_said(dataset):
    names = ["sub-01_acq-a_run-1_T1w.nii", "sub-01_acq-a_run-2_T1w.nii"]
    add(dataset, *names)
    both = only(dataset)
    assert [path.name for path in both.scans] == names
    assert both.prefix == "sub-01_acq-a"
    assert both.notes == (f"2 runs are averaged: {', '.join(names)}",)
    first = only(dataset, several="first")
    assert (first.prefix, len(first.scans)) == ("sub-01_acq-a_run-1", 1)
    assert "only the first is used" in first.notes[0]
    second = only(dataset, run="02")
    assert (second.prefix, second.notes) == ("sub-01_acq-a_run-2", ())
    assert "no T1-weighted scan with run-3" in only(dataset, run="3").trouble


def test_several_protocols_need_a_choice(dataset):
    add(dataset, "sub-01_acq-a_T1w.nii", "sub-01_acq-b_T1w.nii")
    assert "choose one with --filter acq-a or --filter acq-b, or name" in only(dataset).trouble
    assert only(dataset, acquisition="b").prefix == "sub-01_acq-b"


def test_a_filter_takes_any_entity_and_its_absence(dataset):
    add(dataset, "sub-01_rec-norm_T1w.nii", "sub-01_T1w.nii")
    assert "--filter rec- or --filter rec-norm" in only(dataset).trouble
    assert only(dataset, entities=(("rec", "norm"),)).prefix == "sub-01_rec-norm"
    assert (
        only(dataset, entities=(("rec", ""),)).prefix == only(dataset, acquisition="", entities=(("rec", ""),)).prefix
    )
    assert only(dataset, entities=(("rec", ""),)).prefix == "sub-01"
    assert only(dataset, entities=(("ce", "gd"),)).trouble == "sub-01 has no T1-weighted scan with ce-gd"
    refuses("the entity of a filter is 'desc'; one of task, acq", only, dataset, entities=(("desc", "x"),))


def test_digits_count_as_numbers(dataset):
    add(dataset, "sub-10_run-10_T1w.nii", "sub-10_run-2_T1w.nii", "sub-9_ses-10_T1w.nii", "sub-9_ses-2_T1w.nii")
    add(dataset, "sub-x_run-02_T1w.nii", "sub-x_run-1_T1w.nii")
    found = visits_of_bids(dataset, Choice(several="first"))
    assert [visit.prefix for visit in found] == ["sub-9_ses-2", "sub-9_ses-10", "sub-10_run-2", "sub-x_run-1"]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("sub-01_a/anat/sub-01_a_T1w.nii.gz", "the label of the folder sub-01_a may have letters and digits only"),
        ("sub-01-a/anat/sub-01-a_T1w.nii.gz", "the label of the folder sub-01-a may have letters and digits only"),
        ("sub-01/ses-1/anat/sub-01_T1w.nii.gz", "its name lacks ses-1, the name of its folder"),
        ("sub-01/anat/sub-02_T1w.nii.gz", "its name lacks sub-01"),
        ("sub-01/anat/sub-01_ses-1_T1w.nii.gz", "it lies in no folder ses-1"),
        ("sub-01/anat/sub-01_acq-a-b_T1w.nii.gz", "'acq-a-b' is no entity"),
        ("sub-01/anat/sub-01_mprage_T1w.nii.gz", "'mprage' is no entity"),
        ("sub-01/anat/sub-01_run-x_T1w.nii.gz", "run-x has no number"),
        ("sub-01/anat/sub-01_desc-brain_T1w.nii.gz", "a raw T1-weighted scan has no entity desc"),
        ("sub-01/anat/sub-01_run-1_acq-a_T1w.nii.gz", "sub-01_acq-a_run-1_T1w.nii.gz is needed"),
        ("sub-01/anat/sub-01_T1.nii.gz", "its suffix is T1; T1w is needed"),
        ("sub-01/anat/sub-01_part-phase_T1w.nii.gz", "it holds the phase"),
    ],
)
def test_the_rule_that_a_name_breaks_is_said(dataset, name, why):
    (dataset / name).parent.mkdir(parents=True)
    (dataset / name).write_text("")
    assert why in only(dataset).trouble


@pytest.mark.parametrize(
    "names",
    [
        ["sub-01_T1w.nii", "sub-01_T1w.nii.gz"],
        ["sub-01_run-1_T1w.nii", "sub-01_run-01_T1w.nii"],
    ],
)
def test_a_run_that_is_there_twice(dataset, names):
    add(dataset, *names)
    assert "are the same run twice" in only(dataset).trouble


def test_half_a_data_set(dataset):
    add(dataset, "sub-01_T2w.nii", "sub-02_T1.nii.gz")
    (dataset / "sub-03").mkdir()
    found = visits_of_bids(dataset)
    assert [visit.label for visit in found] == ["sub-01", "sub-02", "sub-03"]
    assert all("has no T1-weighted scan" in visit.trouble for visit in found)
    assert "anat holds sub-02_T1.nii.gz" in found[1].trouble
    (dataset / "participants.tsv").write_text("participant_id\tage\nsub-01\t3\nsub-04\t5\n")
    assert missing_participants(dataset) == ["sub-04"]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "has no dataset_description.json"),
        ("{", "is not JSON"),
        ("[1]", "holds a list"),
        ('{"Name": "x"}', "lacks BIDSVersion"),
    ],
)
def test_a_description_that_will_not_do(dataset, text, why):
    add(dataset, "sub-01_T1w.nii")
    file = dataset / "dataset_description.json"
    file.unlink() if text is None else file.write_text(text)
    refuses(why, visits_of_bids, dataset)


def test_no_participants_and_no_folder(dataset):
    refuses(r"no folder sub-", visits_of_bids, dataset)
    refuses("is no folder", visits_of_bids, dataset / "nowhere")


@pytest.mark.parametrize("closed", ["sub-01", "sub-01/anat", "sub-01/ses-b"])
def test_a_folder_without_permission_is_the_trouble_of_its_participant_only(dataset, monkeypatch, closed):
    add(dataset, "sub-01_T1w.nii.gz", "sub-01_ses-b_T1w.nii.gz", "sub-02_T1w.nii.gz")
    scandir = os.scandir

    def guarded(path):
        if Path(path).is_relative_to(dataset / closed):
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", guarded)
    first, second = visits_of_bids(dataset)
    assert (first.label, second.label) == ("sub-01", "sub-02")
    assert first.trouble.startswith(str(dataset / closed))
    assert first.trouble.endswith("cannot be read (Permission denied); give yourself the permission")
    assert second.trouble is None


def test_a_t2_called_t1_is_seen_in_its_sidecar(dataset):
    add(dataset, "sub-01_T1w.nii", "sub-02_T1w.nii")
    (dataset / "T1w.json").write_text('{"EchoTime": 0.35}')
    (dataset / "sub-02" / "anat" / "sub-02_T1w.json").write_text('{"EchoTime": 0.003}')
    first, second = visits_of_bids(dataset)
    assert "an echo time of 350 ms" in first.warnings[0].text
    assert first.warnings[0].name == "long_echo_time"
    assert first.warnings[0].text.endswith("is it a T2?")
    assert second.warnings == ()


def test_a_sidecar_that_cannot_be_read_is_a_warning(dataset):
    add(dataset, "sub-01_T1w.nii")
    (dataset / "sub-01" / "anat" / "sub-01_T1w.json").write_bytes(b'{"EchoTime": \xff')
    visit = only(dataset)
    assert visit.trouble is None
    assert visit.warnings[0].text.endswith("the sidecar is not used")


def test_nearer_sidecars_count_more(dataset):
    add(dataset, "sub-01_ses-a_acq-x_T1w.nii")
    scan = dataset / "sub-01/ses-a/anat/sub-01_ses-a_acq-x_T1w.nii"
    for name, facts in {
        "T1w.json": {"a": 0, "b": 0, "c": 0},
        "acq-x_T1w.json": {"b": 1},
        "acq-y_T1w.json": {"b": 9},
        "T2w.json": {"a": 9},
        "sub-01/sub-01_T1w.json": {"c": 2},
    }.items():
        (dataset / name).write_text(json.dumps(facts))
    assert sidecar_of(dataset, scan) == {"a": 0, "b": 1, "c": 2}


@pytest.fixture
def derivatives(tmp_path_factory):
    folder = tmp_path_factory.mktemp("masks")
    (folder / "dataset_description.json").write_text('{"Name": "m", "BIDSVersion": "1.10.0"}')
    return folder


def test_brain_masks_come_from_derivatives(dataset, derivatives):
    add(dataset, "sub-01_ses-a_run-1_T1w.nii", "sub-02_T1w.nii", "sub-03_T1w.nii")
    add(derivatives, "sub-01_ses-a_desc-brain_mask.nii.gz", "sub-01_ses-a_run-1_desc-brain_mask.nii.gz")
    add(derivatives, "sub-01_ses-a_run-2_desc-brain_mask.nii.gz", "sub-02_space-MNI152_desc-brain_mask.nii.gz")
    add(derivatives, "sub-03_desc-brain_mask.nii.gz", "sub-03_space-T1w_desc-brain_mask.nii.gz")
    first, second, third = visits_of_bids(dataset, Choice(derivatives=derivatives))
    assert first.mask.name == "sub-01_ses-a_run-1_desc-brain_mask.nii.gz"
    assert "no brain mask for sub-02; sub-02_desc-brain_mask.nii.gz in sub-02/anat is needed" in second.trouble
    assert "fit sub-03 equally well" in third.trouble


def test_derivatives_must_be_a_data_set(dataset, derivatives):
    add(dataset, "sub-01_T1w.nii")
    (derivatives / "dataset_description.json").unlink()
    refuses("has no dataset_description", visits_of_bids, dataset, Choice(derivatives=derivatives))
