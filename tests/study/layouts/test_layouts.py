"""The three layouts, read back by nibabel and SimpleITK and compared with computations of their own."""

import dataclasses
import json

import nibabel
import numpy as np
import pytest
import SimpleITK

from bright_head import BRIGHTNESS, CENTRES, RADIUS, bright_head, bright_template
from meshot.mesh.io import read_mesh
from meshot.pipeline import itk_transform, lta_transform
from meshot.study import LAYOUTS, layout_named
from meshot.study.bids import Visit
from meshot.study.comparison import find_surfaces
from meshot.study.layouts import conformed_scan
from meshot.volume.io import read_volume
from refusals import refuses

VISIT = Visit("01", "b", entities=(("acq", "x"),))
#: The shift of the flow, in mm of the template.
SHIFT = 2.0


@pytest.fixture
def scan(turned_scan):
    return read_volume(turned_scan)


@pytest.fixture
def visit(turned_scan):
    return Visit("01", "b", (turned_scan,), (("acq", "x"),))


@pytest.fixture
def written(tmp_path, found, scan, visit):
    def write(name):
        folder = tmp_path / name
        folder.mkdir()
        LAYOUTS[name].arrange(folder, found, scan, visit)
        return folder

    return write


def centre_of(vertices):
    return (vertices.min(axis=0) + vertices.max(axis=0)) / 2


def require_balls(vertices_by_side, shifted):
    """Balls of the right size where the head was made, up to voxels of 4 mm."""
    for side, vertices in vertices_by_side.items():
        expected = np.add(CENTRES[side], (0, 0, SHIFT if shifted else 0))
        np.testing.assert_allclose(centre_of(vertices), expected, atol=1.5)
        np.testing.assert_allclose(np.linalg.norm(vertices - centre_of(vertices), axis=1), RADIUS, atol=3)


def test_freesurfer_surfaces_are_in_the_surface_ras_of_orig(written):
    folder = written("freesurfer")
    assert sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()) == [
        "mri/filled.mgz", "mri/orig.mgz", "mri/rawavg.mgz", "mri/transforms/orig_to_MNI152NLin2009aSym.lta",
        "mri/transforms/orig_to_MNI152NLin2009aSym.txt", "surf/lh.orig", "surf/lh.white",
        "surf/rh.orig", "surf/rh.white",
    ]  # fmt: skip
    orig = nibabel.load(folder / "mri" / "orig.mgz")
    assert (orig.shape, orig.get_data_dtype()) == ((256, 256, 256), np.uint8)
    assert nibabel.aff2axcodes(orig.affine) == ("L", "I", "A")
    # nibabel computes both matrices from the header: from voxels to scanner RAS, and to FreeSurfer's surface RAS.
    to_scanner = orig.affine @ np.linalg.inv(orig.header.get_vox2ras_tkr())
    for name, shifted in (("white", True), ("orig", False)):
        surfaces = {}
        for side, short in (("left", "lh"), ("right", "rh")):
            vertices, _, header = nibabel.freesurfer.read_geometry(
                folder / "surf" / f"{short}.{name}", read_metadata=True
            )
            surfaces[side] = vertices @ to_scanner[:3, :3].T + to_scanner[:3, 3]
            np.testing.assert_allclose(header["cras"], orig.header["Pxyz_c"], atol=1e-3)
        require_balls(surfaces, shifted)


def test_freesurfer_volumes_show_the_head_where_the_surfaces_are(written, scan):
    folder = written("freesurfer")
    raw = nibabel.load(folder / "mri" / "rawavg.mgz")
    np.testing.assert_allclose(raw.affine, scan.affine, atol=1e-4)
    np.testing.assert_allclose(np.asarray(raw.dataobj), scan.data, rtol=1e-6)
    orig, filled = (nibabel.load(folder / "mri" / f"{name}.mgz") for name in ("orig", "filled"))
    assert set(np.unique(np.asarray(filled.dataobj))) == {0, 127, 255}
    for side, value in (("left", 255), ("right", 127)):
        inside = np.asarray(filled.dataobj) == value
        middle = nibabel.affines.apply_affine(filled.affine, np.argwhere(inside).mean(axis=0))
        np.testing.assert_allclose(middle, CENTRES[side], atol=1)
        assert inside.sum() == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.1)
        assert np.median(np.asarray(orig.dataobj)[inside]) == pytest.approx(255 * BRIGHTNESS[side], abs=2)


def test_the_conformed_scan_keeps_a_point_in_its_place(scan):
    conformed = conformed_scan(scan)
    centre = scan.affine[:3, :3] @ (np.array(scan.data.shape) / 2) + scan.affine[:3, 3]
    np.testing.assert_allclose(conformed.affine[:3] @ [128, 128, 128, 1], centre)
    assert (conformed.data.min(), conformed.data.max()) == (0, 255)


def test_bids_derivatives_are_gifti_in_scanner_ras(written):
    anat = written("bids") / "anat"
    start = "sub-01_ses-b_acq-x"
    surfaces = {}
    for side, letter in (("left", "L"), ("right", "R")):
        for name in ("white", "desc-initial_white"):
            points, triangles = nibabel.load(anat / f"{start}_hemi-{letter}_{name}.surf.gii").darrays
            assert points.meta["AnatomicalStructurePrimary"] == f"Cortex{side.capitalize()}"
            assert points.meta["AnatomicalStructureSecondary"] == "GrayWhite"
            assert points.coordsys.dataspace == points.coordsys.xformspace == 1
            np.testing.assert_array_equal(points.coordsys.xform, np.eye(4))
            assert triangles.data.max() == len(points.data) - 1
            assert (anat / f"{start}_hemi-{letter}_{name}.json").is_file()
            if name == "white":
                surfaces[side] = points.data
    require_balls(surfaces, shifted=True)
    labels = nibabel.load(anat / f"{start}_desc-whitematter_dseg.nii.gz")
    assert set(np.unique(np.asarray(labels.dataobj))) == {0, 1, 2}
    said = json.loads((anat / f"{start}_desc-whitematter_dseg.json").read_text(encoding="utf-8"))
    assert said["SpatialReference"] == said["Sources"][0]
    assert {"Description", "Manual"} < set(said)
    head = bright_head(labels.affine, labels.shape).data
    overlap = [(np.asarray(labels.dataobj) == value) & (head > 0.5 * bright) for value, bright in ((1, 0.4), (2, 1.0))]
    assert all(part.sum() > 0.9 * (np.asarray(labels.dataobj) == value).sum() for value, part in zip((1, 2), overlap))


def test_the_study_of_derivatives_is_described(tmp_path):
    layout = layout_named("bids")
    assert layout.folder(VISIT).as_posix() == "sub-01/ses-b"
    layout.begin(tmp_path, tmp_path.parent)
    described = json.loads((tmp_path / "dataset_description.json").read_text(encoding="utf-8"))
    assert described["DatasetType"] == "derivative"
    assert described["DatasetLinks"] == {"raw": ".."}
    # The validator does not apply a pattern that ends in a slash to folders further down.
    assert {"report", "*_xfm.*", "*.surf.gii"} < set((tmp_path / ".bidsignore").read_text(encoding="utf-8").split())
    (tmp_path / ".bidsignore").write_text("mine")
    layout.begin(tmp_path, None)
    assert (tmp_path / ".bidsignore").read_text(encoding="utf-8") == "mine"


def test_itk_reads_the_transform(tmp_path):
    """A point of the template goes to the point of the scan that belongs to it, as ITK resamples images."""
    to_standard = np.array([[0.9, 0.1, 0, 3], [-0.2, 1.1, 0, -5], [0, 0.1, 1, 7], [0, 0, 0, 1.0]])
    (tmp_path / "a.txt").write_text(itk_transform(to_standard))
    transform = SimpleITK.ReadTransform(str(tmp_path / "a.txt"))
    in_scan = np.array([10.0, -20.0, 30.0])
    in_template = (to_standard @ [*in_scan, 1])[:3]
    found = np.array(transform.TransformPoint((in_template * [-1, -1, 1]).tolist())) * [-1, -1, 1]
    np.testing.assert_allclose(found, in_scan, atol=1e-9)


def test_the_lta_holds_the_matrix_and_both_grids(scan):
    to_standard = np.array([[0.9, 0.1, 0, 3], [-0.2, 1.1, 0, -5], [0, 0.1, 1, 7], [0, 0, 0, 1.0]])
    lines = lta_transform(to_standard, scan, "a.nii.gz", bright_template()).splitlines()
    assert lines[0].startswith("type      = 1")
    np.testing.assert_allclose([[float(x) for x in line.split()] for line in lines[5:9]], to_standard)
    facts = [line.split("=") for line in lines[10:] if "=" in line]
    for start, volume in ((0, scan), (8, bright_template())):
        values = {key.strip(): value.split("#")[0].split() for key, value in facts[start : start + 8]}
        header = nibabel.MGHImage(volume.data.astype(np.float32), volume.affine).header
        assert [int(n) for n in values["volume"]] == list(volume.data.shape)
        axes = np.array([[float(x) for x in values[key]] for key in ("xras", "yras", "zras")])
        np.testing.assert_allclose(axes, header["Mdc"], atol=1e-6)
        np.testing.assert_allclose([float(x) for x in values["cras"]], header["Pxyz_c"], atol=1e-3)


@pytest.mark.parametrize(
    ("name", "place"),
    [("flat", "{}h.pial"), ("freesurfer", "surf/{}h.pial"), ("bids", "anat/sub-01_ses-b_acq-x_hemi-{}_pial.surf.gii")],
)
def test_a_pial_surface_has_the_place_that_others_expect(name, place, tmp_path, found, scan, visit):
    outer = {
        side: dataclasses.replace(each, pial=each.final.with_vertices(1.1 * each.final.vertices))
        for side, each in found.surfaces.items()
    }
    folder = tmp_path / "study" / "sub-01"
    folder.mkdir(parents=True)
    LAYOUTS[name].arrange(folder, dataclasses.replace(found, surfaces=outer), scan, visit)
    for side, each in outer.items():
        path = folder / place.format(side[0].upper() if name == "bids" else side[0])
        np.testing.assert_allclose(read_mesh(path).vertices, each.pial.vertices, atol=1e-3)
        middle = read_mesh(path.with_name(path.name.replace("pial", "midthickness")))
        np.testing.assert_allclose(middle.vertices, 1.05 * each.final.vertices, atol=1e-3)
        assert path.with_name(path.name.removesuffix(".surf.gii") + ".json").is_file() == (name == "bids")
    assert {place.side for place in find_surfaces(tmp_path / "study", "pial")} == {"left", "right"}
    LAYOUTS[name].begin(folder, None)
    ignored = {"*_pial.json", "*_midthickness.json", "regions.*"}
    assert name != "bids" or ignored <= set((folder / ".bidsignore").read_text(encoding="utf-8").split())


def test_an_unknown_layout_is_refused():
    refuses("no layout 'fs'; known are flat, freesurfer, bids", layout_named, "fs")
