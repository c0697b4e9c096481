"""Numbers of lobes, on fsaverage5 itself: each is changed in one place, and the lobe there shows it."""

import dataclasses

import numpy as np
import pytest
import torch

from meshot.anatomy import HEMISPHERES, desikan_killiany, from_mni152, fsaverage5_surface
from meshot.mesh import Mesh, vertex_areas
from meshot.pipeline import lobes as module
from meshot.pipeline.initial_surface import SegmentedSurface
from meshot.pipeline.lobes import (
    LOBE_LIMITS,
    LOBES,
    REGIONS_OF_LOBES,
    doubts_in_words,
    doubts_of_lobes,
    lobe_numbers,
    template_places,
)
from meshot.pipeline.reconstruction import HemisphereSurface, Reconstruction
from meshot.provenance import read_results
from meshot.volume import StandardScan, Volume
from meshot.volume.surfaces import enclosed_voxels

GRID_AFFINE = np.array([[2.0, 0, 0, -80], [0, 2, 0, -120], [0, 0, 2, -70], [0, 0, 0, 1]])
#: Near the left frontal pole, and near the right occipital one, in mm.
FRONTAL, OCCIPITAL = np.array([-10.0, 62, 0]), np.array([10.0, -98, 5])


@pytest.fixture(scope="module")
def head() -> tuple[Reconstruction, Volume]:
    """Both white surfaces of fsaverage5 as a reconstruction, of a scan that is 2 inside and 1 outside."""
    grid = Volume(np.ones((80, 110, 80)), GRID_AFFINE)
    data, surfaces = grid.data.copy(), {}
    for side in HEMISPHERES:
        white = fsaverage5_surface("white", side, "MNI152")
        mask = grid.with_data(enclosed_voxels(white, grid))
        data[mask.data] = 2
        segmented = SegmentedSurface(white, white, mask, mask, mask)
        surfaces[side] = HemisphereSurface(white, white, segmented, None, unrepaired=white)
    standard = StandardScan(grid.with_data(data), np.eye(4))
    return Reconstruction(standard, surfaces, {}, {}, (), "none", standard), standard.volume


def changed(head: Reconstruction, side: str, **parts: object) -> Reconstruction:
    surfaces = head.surfaces | {side: dataclasses.replace(head.surfaces[side], **parts)}
    return dataclasses.replace(head, surfaces=surfaces)


def near(mesh: Mesh, place: np.ndarray, mm: float) -> torch.Tensor:
    return (mesh.vertices - torch.from_numpy(place)).norm(dim=1) < mm


def test_every_region_is_in_one_lobe():
    regions = [region for each in REGIONS_OF_LOBES.values() for region in each]
    assert len(set(regions)) == len(regions) == 34
    for side in HEMISPHERES:
        atlas = desikan_killiany(side)
        assert set(regions) == {name for name in atlas.names if name in regions}
        distances, lobes = template_places(fsaverage5_surface("white", side, "MNI152"), side)
        assert not distances.any()
        for region, lobe in (("precentral", "frontal"), ("cuneus", "occipital"), ("temporalpole", "temporal")):
            assert set(lobes[atlas.labels == atlas.names.index(region)]) == {LOBES.index(lobe)}
        assert set(lobes[atlas.labels == 0]) == {-1}


def test_a_head_as_the_template_is_usual(head):
    found, scan = head
    numbers = lobe_numbers(found, scan)
    for side, surface in found.surfaces.items():
        known = template_places(surface.final, side)[1] >= 0
        total = sum(row["area_mm2"] for row in numbers[side].values())
        assert total == pytest.approx(float(vertex_areas(surface.final)[torch.from_numpy(known)].sum()))
        for row in numbers[side].values():
            assert row["brightness"] == pytest.approx(1, abs=0.15)
            assert row["brighter_inside"] > 0.8
            assert (row["given_up_mm3"], row["repaired"], row["from_template_mm"]) == (0, 0, 0)


def test_what_is_given_up_is_found_in_its_lobe(head):
    found, scan = head
    segmented = found.surfaces["left"].segmented
    ball = segmented.genus_zero_mask.data.copy()
    inside = np.argwhere(ball)
    away = np.linalg.norm(inside @ GRID_AFFINE[:3, :3].T + GRID_AFFINE[:3, 3] - FRONTAL, axis=1)
    ball[tuple(inside[away < 12].T)] = False
    cut = dataclasses.replace(segmented, genus_zero_mask=scan.with_data(ball))
    numbers = lobe_numbers(changed(found, "left", segmented=cut), scan)
    assert numbers["left"]["frontal"]["given_up_mm3"] == pytest.approx(8 * (away < 12).sum())
    assert (away < 12).sum() > 50
    others = [(side, lobe) for side in numbers for lobe in LOBES if (side, lobe) != ("left", "frontal")]
    assert all(numbers[side][lobe]["given_up_mm3"] == 0 for side, lobe in others)


def test_what_is_moved_by_the_repair_or_far_away_is_found_in_its_lobe(head):
    found, scan = head
    white = found.surfaces["right"].final
    here = near(white, OCCIPITAL, 20)
    out = torch.tensor([0.0, -4.0, 0.0], dtype=white.vertices.dtype)
    numbers = lobe_numbers(
        changed(found, "right", final=white.with_vertices(white.vertices + here[:, None] * out)), scan
    )
    usual = lobe_numbers(found, scan)
    row = numbers["right"]["occipital"]
    assert row["repaired"] == pytest.approx(float(vertex_areas(white)[here].sum()) / row["area_mm2"], rel=0.3)
    assert 0.2 < row["from_template_mm"] < 4
    assert numbers["right"]["temporal"]["repaired"] == 0
    for lobe in LOBES:
        assert numbers["left"][lobe]["from_template_mm"] == usual["left"][lobe]["from_template_mm"] == 0


def test_brightness_and_contrast_are_of_a_lobe(head):
    found, scan = head
    middles = np.indices(scan.data.shape).T @ GRID_AFFINE[:3, :3].T + GRID_AFFINE[:3, 3]
    front = (middles[..., 1] > 10).T
    usual = lobe_numbers(found, scan)
    numbers = lobe_numbers(found, scan.with_data(np.where(front, 1.6 * scan.data, scan.data)))
    for side in HEMISPHERES:
        assert numbers[side]["frontal"]["brightness"] > 1.3
        assert numbers[side]["occipital"]["brightness"] == pytest.approx(
            usual[side]["occipital"]["brightness"], abs=0.1
        )
    flat = lobe_numbers(found, scan.with_data(np.where(front, 2.0, scan.data)))
    for side in HEMISPHERES:
        assert flat[side]["frontal"]["brighter_inside"] < 0.5
        assert flat[side]["occipital"]["brighter_inside"] == usual[side]["occipital"]["brighter_inside"]


def test_places_are_in_mni152_space_also_in_the_enlarged_one(head):
    found, scan = head
    usual = lobe_numbers(found, scan)
    # The scanner's space is that of the template; the standard space is enlarged.
    to_standard = np.eye(4)
    points = torch.cat([torch.zeros(1, 3), torch.eye(3)]).double()
    corners = from_mni152(Mesh(points, torch.tensor([[0, 1, 2], [0, 1, 3]]))).vertices.numpy()
    to_standard[:3, :3], to_standard[:3, 3] = (corners[1:] - corners[0]).T, corners[0]
    placed = dataclasses.replace(found, scan=StandardScan(scan, to_standard), placement="white matter")
    numbers = lobe_numbers(placed, scan)
    for side in HEMISPHERES:
        for lobe in LOBES:
            assert numbers[side][lobe]["from_template_mm"] < 1e-6
            assert numbers[side][lobe]["area_mm2"] == pytest.approx(usual[side][lobe]["area_mm2"])


def test_doubts_are_named(head, monkeypatch):
    found, scan = head
    assert [each.word for each in LOBE_LIMITS.values()] == ["bias", "contrast", "cut", "repaired", "shape"]
    limits = {name: dataclasses.replace(each, low=-1e9, high=1e9) for name, each in LOBE_LIMITS.items()}
    monkeypatch.setattr(module, "LOBE_LIMITS", limits)
    numbers = lobe_numbers(found, scan)
    assert doubts_of_lobes(numbers) == {}
    assert doubts_in_words({}) == ""
    numbers["right"]["insula"] |= {"given_up_mm3": 2e9, "brightness": -2e9}
    numbers["left"]["frontal"]["repaired"] = float("nan")
    doubts = doubts_of_lobes(numbers)
    assert doubts == {"left": {"frontal": ["repaired"]}, "right": {"insula": ["bias", "cut"]}}
    assert doubts_in_words(doubts) == "left frontal (repaired); right insula (bias, cut)"


def test_a_lobe_that_is_missing_is_doubted(head):
    """A surface that covers only the front."""
    found, scan = head
    white = found.surfaces["left"].final
    front = white.faces[(white.vertices[white.faces][:, :, 1] > 30).all(dim=1)]
    kept, faces = torch.unique(front, return_inverse=True)
    part = Mesh(white.vertices[kept], faces)
    numbers = lobe_numbers(changed(found, "left", final=part, unrepaired=None), scan)
    assert numbers["left"]["occipital"]["area_mm2"] == 0
    assert doubts_of_lobes(numbers)["left"]["occipital"] == ["bias", "contrast", "cut", "repaired", "shape"]


def test_the_limits_are_those_of_good_heads(root):
    """The extremes of all their lobes, moved by a fifth of the range."""
    rows = read_results(root / "experiments" / "warnings" / "lobes.json")["results"]["rows"]
    good = [lobe for row in rows if not row["spoiled"] for side in row["lobes"].values() for lobe in side.values()]
    assert len(good) == 240
    for name, limit in LOBE_LIMITS.items():
        values = np.array([lobe[name] for lobe in good])
        margin = 0.2 * (values.max() - values.min())
        if limit.low > 0:
            assert limit.low == pytest.approx(values.min() - margin, abs=0.001)
        if limit.high < 1e9 and name != "brighter_inside":
            assert limit.high == pytest.approx(values.max() + margin, rel=0.003)
    assert doubts_of_lobes({"left": {"frontal": good[0]}}) == {}
