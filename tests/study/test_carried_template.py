"""The carried template in the three layouts, and in a study that was made before without it."""

import dataclasses

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


def test_a_study_without_it_is_not_taken_for_one_with_it(quick, settings, turned_scan, tmp_path):
    (visit,) = visits_of_files([turned_scan])
    made = one_visit.reconstruct_visit(visit, tmp_path, settings)
    asked = dataclasses.replace(settings, correspondence=True)
    refuses("made before with another choice of --template", one_visit.reconstruct_visit, visit, tmp_path, asked)
    again = one_visit.reconstruct_visit(visit, tmp_path, dataclasses.replace(asked, overwrite=True))
    assert (made["correspondence"], again["correspondence"]) == (False, True)
    # What has more than is asked for is kept.
    assert one_visit.reconstruct_visit(visit, tmp_path, settings)["correspondence"]
