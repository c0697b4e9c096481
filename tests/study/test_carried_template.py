"""The carried template in the three layouts, and in a study that was made before without it."""

import csv
import dataclasses
import json
import shutil

import pytest
import torch

from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.io import read_mesh
from meshot.pipeline import CarriedTemplate
from meshot.study import layout_named, many_visits as one_visit, visits_of_files
from meshot.volume.io import read_volume
from refusals import refuses

#: What each layout has of the regions of the cortex.
REGIONS = {
    "flat": {"regions.tsv", "regions.json", "lh.aparc.stats", "rh.aparc.annot"},
    "freesurfer": {"regions.tsv", "regions.json", "rh.aparc.stats", "lh.aparc.annot"},
    "bids": {"atlas-DesikanKilliany_morph.tsv", "atlas-DesikanKilliany_morph.json",
             "hemi-R_atlas-DesikanKilliany_dseg.label.gii"},
}  # fmt: skip


@pytest.fixture
def with_template(found):
    surfaces = {
        side: dataclasses.replace(surface, carried=CarriedTemplate(fsaverage5_surface("white", side), 0.5, 7, 0))
        for side, surface in found.surfaces.items()
    }
    return dataclasses.replace(found, surfaces=surfaces)


@pytest.mark.parametrize(
    ("layout", "file"),
    [
        ("flat", "lh.fsaverage5.surf.gii"),
        ("freesurfer", "surf/lh.white.fsaverage5"),
        ("bids", "anat/scan_hemi-L_desc-fsaverage5_white.surf.gii"),
    ],
)
def test_every_layout_has_it(with_template, turned_scan, tmp_path, layout, file):
    (visit,) = visits_of_files([turned_scan])
    (tmp_path / "surf").mkdir()
    (tmp_path / "mri").mkdir()
    layout_named(layout).arrange(tmp_path, with_template, read_volume(turned_scan), visit)
    name = file.replace("scan_", f"{visit.prefix}_")
    mesh = read_mesh(tmp_path / name)
    truth = fsaverage5_surface("white", "left")
    assert torch.equal(mesh.faces, truth.faces)
    names = {path.name.removeprefix(f"{visit.prefix}_") for path in tmp_path.rglob("*") if path.is_file()}
    assert REGIONS[layout] <= names


@pytest.mark.parametrize("layout", list(REGIONS))
def test_a_study_has_the_regions_of_all_visits(with_template, settings, turned_scan, tmp_path, layout, monkeypatch):
    """Two visits with the template, one of them with a pial surface, and one without a table."""
    thick = {
        side: dataclasses.replace(surface, pial=surface.final.with_vertices(1.05 * surface.final.vertices))
        for side, surface in with_template.surfaces.items()
    }
    made = iter([with_template, dataclasses.replace(with_template, surfaces=thick)])
    monkeypatch.setattr(one_visit, "reconstruct", lambda *_: next(made))
    paths = [tmp_path / f"{name}_T1w.nii.gz" for name in ("sub-02", "sub-01")]
    visits = [visit for path in paths for visit in visits_of_files([shutil.copy(turned_scan, path)])]
    study = tmp_path / "study"
    chosen = dataclasses.replace(settings, layout=layout, correspondence=True)
    for visit in visits:
        one_visit.reconstruct_visit(visit, study, chosen)
    one_visit.write_table(study)
    with (study / "regions.tsv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file, dialect="excel-tab"))
    n = len(rows) // 2
    assert [row["participant_id"] for row in rows] == ["sub-01"] * n + ["sub-02"] * n
    assert [row["region"] for row in rows[:n]] == [row["region"] for row in rows[n:]]
    assert {row["hemisphere"] for row in rows} == {"left", "right"}
    assert {row["thickness_mm"] for row in rows[n:]} == {"n/a"}
    assert all(float(row["area_mm2"]) >= 0 for row in rows)
    assert any(0.1 < float(row["thickness_mm"]) < 5 for row in rows[:n] if row["thickness_mm"] != "n/a")
    described = json.loads((study / "regions.json").read_text(encoding="utf-8"))
    assert list(described) == list(rows[0])
    assert described["thickness_mm"]["Units"] == "mm"


def test_a_study_without_it_is_not_taken_for_one_with_it(quick, settings, turned_scan, tmp_path):
    (visit,) = visits_of_files([turned_scan])
    made = one_visit.reconstruct_visit(visit, tmp_path, settings)
    asked = dataclasses.replace(settings, correspondence=True)
    refuses("made before with another choice of --template", one_visit.reconstruct_visit, visit, tmp_path, asked)
    again = one_visit.reconstruct_visit(visit, tmp_path, dataclasses.replace(asked, overwrite=True))
    assert (made["correspondence"], again["correspondence"]) == (False, True)
    # What has more than is asked for is kept.
    assert one_visit.reconstruct_visit(visit, tmp_path, settings)["correspondence"]
