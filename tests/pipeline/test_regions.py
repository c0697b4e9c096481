"""Numbers by region: sums are those of the whole, spheres have those of spheres, and FreeSurfer's form is kept."""

import dataclasses
import json
import math

import nibabel.freesurfer
import numpy as np
import pytest
import torch

from meshot.anatomy.regions import Parcellation, desikan_killiany
from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from meshot.mesh.geometry import face_areas, face_normals, signed_volume, vertex_areas
from meshot.mesh.shapes import icosphere
from meshot.pipeline.correspondence import CarriedTemplate
from meshot.pipeline.initial_surface import SegmentedSurface
from meshot.pipeline.reconstruction import HemisphereSurface, Reconstruction
from meshot.pipeline.regions import COLUMNS, region_numbers, vertex_regions, write_regions
from meshot.pipeline.report import FLAT_REGIONS
from meshot.volume.registration import StandardScan
from meshot.volume.volume import Volume
from refusals import refuses

RADIUS = 30.0
HALVES = Parcellation("halves", np.array([0, 1, 2]), ("unknown", "low", "high"), ((0, 0, 0), (1, 2, 3), (4, 5, 6)))


@pytest.fixture(scope="module")
def halves():
    """A ball in two regions, with a rim that belongs to none, and one around it."""
    ball = icosphere(5, radius=RADIUS)
    heights = ball.vertices[:, 2].numpy()
    labels = np.where(np.abs(heights) < 1, 0, np.where(heights < 0, 1, 2))
    return ball, labels, ball.with_vertices(ball.vertices * (1 + 2.5 / RADIUS))


def test_a_sphere_has_the_numbers_of_a_sphere(halves):
    ball, labels, around = halves
    low, high = region_numbers(ball, labels, HALVES, around)
    assert (low["region"], high["region"]) == ("low", "high")
    for label, row in ((1, low), (2, high)):
        here, areas = labels == label, vertex_areas(ball).numpy()
        assert row["n_vertices"] == here.sum()
        assert row["area_mm2"] == pytest.approx(areas[here].sum())
        assert row["area_mm2"] == pytest.approx(2 * math.pi * RADIUS * (RADIUS - 1), rel=0.02)
        assert row["thickness_mm"] == pytest.approx(2.5, abs=0.01)
        assert row["thickness_sd_mm"] < 0.01
        assert row["volume_mm3"] == pytest.approx(row["area_mm2"] * 2.5 * (1 + 2.5 / RADIUS), rel=0.01)
        assert row["mean_curvature"] == pytest.approx(1 / RADIUS, rel=0.01)
        assert row["gaussian_curvature"] == pytest.approx(1 / RADIUS**2, rel=0.02)
        assert row["curvature_index"] == pytest.approx(row["area_mm2"] / (4 * math.pi * RADIUS**2), rel=0.02)
        assert row["folding_index"] < 0.05


def test_sums_over_regions_are_those_of_the_surface(halves):
    ball, _, around = halves
    everything = Parcellation("all", np.array([1]), ("unknown", "all"), ((0, 0, 0), (1, 1, 1)))
    (row,) = region_numbers(ball, np.ones(len(ball.vertices), dtype=np.int64), everything, around)
    assert row["area_mm2"] == pytest.approx(float(face_areas(ball).sum()))
    assert row["volume_mm3"] == pytest.approx(float(signed_volume(around) - signed_volume(ball)))
    assert row["curvature_index"] == pytest.approx(1, abs=0.002)  # Gauss and Bonnet


def test_a_long_fold_has_a_folding_index(halves):
    """A long thin ellipsoid is nearly a cylinder: |k1| (|k1| - |k2|) is 1/r², with little Gaussian curvature."""
    ball, _, _ = halves
    long = ball.with_vertices(ball.vertices * torch.tensor([0.1, 0.1, 10.0]).double())
    labels = np.where(np.abs(long.vertices[:, 2].numpy()) < 100, 1, 0)
    (row,) = region_numbers(long, labels, HALVES)
    assert row["folding_index"] == pytest.approx(row["area_mm2"] / (4 * math.pi * 9), rel=0.1)
    assert row["curvature_index"] < 0.05 * row["folding_index"]
    assert "thickness_mm" not in row


@pytest.mark.parametrize("side", HEMISPHERES)
def test_vertices_of_a_finer_surface_get_the_regions_below_them(side):
    white, atlas = fsaverage5_surface("white", side), desikan_killiany(side)
    np.testing.assert_array_equal(vertex_regions(white, white, atlas), atlas.labels)
    middles, normals = white.vertices[white.faces].mean(dim=1), face_normals(white)
    away = torch.from_numpy(np.random.default_rng(0).normal(size=(len(middles), 1)))
    corners = (middles + away * normals)[:, None] + tangents(normals)
    small = type(white)(corners.reshape(-1, 3), torch.arange(3 * len(middles)).reshape(-1, 3))
    found = vertex_regions(small, white, atlas).reshape(-1, 3)
    right = (found == atlas.labels[white.faces.numpy()][:, [0]]) | (found == atlas.labels[white.faces.numpy()][:, [1]])
    right |= found == atlas.labels[white.faces.numpy()][:, [2]]
    assert right.mean() > 0.9995
    few = "the carried surface has 42 vertices, and Desikan-Killiany 10242 labels"
    refuses(few, vertex_regions, white, icosphere(1), atlas)


def tangents(normals):
    """Three small vectors across each normal, in the order of a face with this normal."""
    first = torch.linalg.cross(normals, torch.tensor([0.577, 0.578, 0.579]).double().expand_as(normals))
    first = 1e-3 * first / first.norm(dim=1, keepdim=True)
    second = torch.linalg.cross(normals, first)
    return torch.stack([first, -first / 2 + second, -first / 2 - second], dim=1)


def made(with_pial: bool, carried: bool = True) -> Reconstruction:
    """Both white surfaces of fsaverage5 as a reconstruction."""
    mask = Volume(np.ones((2, 2, 2), dtype=bool), np.eye(4))
    surfaces = {}
    for side in HEMISPHERES:
        white, pial = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
        template = CarriedTemplate(white, 0.0, 0, 0) if carried else None
        segmented = SegmentedSurface(white, white, mask, mask, mask)
        surfaces[side] = HemisphereSurface(white, white, segmented, None, template, pial if with_pial else None)
    scan = StandardScan(Volume(np.zeros((2, 2, 2)), np.eye(4)), np.eye(4))
    return Reconstruction(scan, surfaces, {}, {}, (), None, scan)


def test_fsaverage5_has_a_plausible_cortex(tmp_path):
    rows = write_regions(tmp_path, made(with_pial=True), FLAT_REGIONS, "fsaverage5")
    assert len(rows) == 68
    thick = {(row["hemisphere"], row["region"]): row["thickness_mm"] for row in rows}
    assert 2.0 < np.mean(list(thick.values())) < 3.2
    for side in HEMISPHERES:
        assert thick[side, "pericalcarine"] < 2.2 < 2.6 < thick[side, "insula"]
    table = [line.split("\t") for line in (tmp_path / "regions.tsv").read_text().splitlines()]
    assert table[0] == list(COLUMNS)
    assert len(table) == 69
    about = json.loads((tmp_path / "regions.json").read_text())
    assert list(about) == table[0]
    assert about["thickness_mm"]["Units"] == "mm"


def test_files_of_freesurfer_are_read_back(tmp_path):
    found = made(with_pial=True)
    rows = write_regions(tmp_path, found, FLAT_REGIONS, "fsaverage5")
    labels, table, names = nibabel.freesurfer.read_annot(tmp_path / "lh.aparc.annot")
    atlas = desikan_killiany("left")
    np.testing.assert_array_equal(labels, atlas.labels)
    assert [name.decode() for name in names] == list(atlas.names)
    np.testing.assert_array_equal(table[:, :3], atlas.colours)
    thickness = nibabel.freesurfer.read_morph_data(tmp_path / "rh.thickness")
    assert len(thickness) == 10_242
    lines = (tmp_path / "rh.aparc.stats").read_text().splitlines()
    (heads,) = (line.split()[2:] for line in lines if line.startswith("# ColHeaders"))
    body = [dict(zip(heads, line.split(), strict=True)) for line in lines if not line.startswith("#")]
    right = {row["region"]: row for row in rows if row["hemisphere"] == "right"}
    assert {row["StructName"] for row in body} == set(right)
    for row in body:
        mine = right[row["StructName"]]
        assert float(row["ThickAvg"]) == pytest.approx(mine["thickness_mm"], abs=6e-4)
        assert float(row["GrayVol"]) == pytest.approx(mine["volume_mm3"], abs=0.6)
        assert int(row["NumVert"]) == mine["n_vertices"]
    assert "# Measure Cortex, NumVert, Number of Vertices, 10242, unitless" in lines


def test_without_a_pial_surface_thickness_is_not_claimed(tmp_path):
    rows = write_regions(tmp_path, made(with_pial=False), FLAT_REGIONS)
    assert not (tmp_path / "lh.thickness").exists()
    assert "thickness_mm" not in rows[0]
    assert "volume_mm3" not in (tmp_path / "regions.tsv").read_text()
    assert (
        "# No pial surface was found: GrayVol, ThickAvg and ThickStd are 0" in (tmp_path / "lh.aparc.stats").read_text()
    )


def test_without_a_carried_template_there_is_thickness_alone(tmp_path):
    assert write_regions(tmp_path, made(with_pial=True, carried=False), FLAT_REGIONS) == []
    assert {path.name for path in tmp_path.iterdir()} == {"lh.thickness", "rh.thickness"}


def test_a_pial_surface_with_other_faces_gives_no_thickness(tmp_path):
    found = made(with_pial=True)
    other = {side: dataclasses.replace(each, pial=icosphere(2, 60.0)) for side, each in found.surfaces.items()}
    rows = write_regions(tmp_path, dataclasses.replace(found, surfaces=other), FLAT_REGIONS)
    assert "thickness_mm" not in rows[0]
    assert not (tmp_path / "lh.thickness").exists()
