"""The inside of the average: found where atlases have it, and carried with the cortex; leaves of the cerebellum."""

import numpy as np
import pytest
import torch

from meshot.anatomy.templates import MNI305_TO_MNI152
from meshot.mesh.shapes import icosphere
from meshot.synth import heads as module
from meshot.synth.heads import FAN_MM, CarriedHead, Leaves, hindbrain_region, leaf_fractions, template_tissue
from meshot.synth.imaging import TISSUES, Appearance
from meshot.synth.scanning import Anatomy, Position, simulated_scan
from meshot.synth.subject import CorticalSurfaces, HeadWarp
from meshot.volume.volume import Volume
from refusals import refuses

STILL = HeadWarp(torch.ones(3, dtype=torch.float64), None)
TO_MNI = MNI305_TO_MNI152
#: Centres of structures in MNI152, in mm, as atlases list them (AAL; Diedrichsen et al. for the cerebellum).
PLACES = {
    "hindbrain": [(0, -60, -35), (30, -60, -45), (-30, -60, -45), (0, -28, -32), (0, -40, -50)],
    "deep_grey": [(12, 12, 9), (-12, 12, 9), (26, 4, 2), (-26, 4, 2)],
    "ventricles": [(10, 2, 20), (-10, 2, 20), (24, -40, 12), (-24, -40, 12)],
}
ELSEWHERE = [(0, -90, 5), (50, -20, -25), (20, -70, -2), (40, 20, 20), (0, 20, -20), (30, -80, -10)]


def at(volume: Volume, place: tuple[float, ...]) -> float:
    index = np.round(np.linalg.solve(volume.affine, [*place, 1.0])[:3]).astype(int)
    return float(volume.data[tuple(index)])


def test_structures_lie_where_atlases_have_them():
    tissue = template_tissue()
    assert all(at(tissue.hindbrain, place) > 0.5 for place in PLACES["hindbrain"])
    assert all(at(tissue.deep_grey, place) > 0.5 for place in PLACES["deep_grey"])
    assert all(at(tissue.ventricles, place) > 0 for place in PLACES["ventricles"])
    for place in (*ELSEWHERE, *PLACES["deep_grey"], *PLACES["ventricles"]):
        assert at(tissue.hindbrain, place) < 0.5
    for place in (*ELSEWHERE, *PLACES["hindbrain"]):
        assert at(tissue.deep_grey, place) < 0.5
        assert at(tissue.ventricles, place) < 0


def test_volumes_are_those_of_an_adult_and_both_sides_agree():
    tissue = template_tissue()
    voxels = {name: getattr(tissue, name).data for name in ("hindbrain_white", "hindbrain_grey", "deep_grey")}
    voxels["ventricles"] = tissue.ventricles.data > 0
    ranges = {"hindbrain_white": (25, 60), "hindbrain_grey": (120, 200), "deep_grey": (30, 60), "ventricles": (10, 35)}
    middle = round(-tissue.hindbrain.affine[0, 3])
    for name, (low, high) in ranges.items():
        assert low < voxels[name].sum() / 1000 < high, name
        left, right = voxels[name][:middle].sum(), voxels[name][middle + 1 :].sum()
        assert left == pytest.approx(right, rel=0.1), name


def test_a_ball_below_a_ball_is_divided_at_the_gap_between_them():
    places = np.stack(np.meshgrid(*(np.arange(48) - 23.5,) * 3, indexing="ij"), axis=-1)
    upper = np.linalg.norm(places - [0, 0, 11], axis=-1) < 11
    ring = (np.linalg.norm(places - [0, 0, 11], axis=-1) < 13) & ~upper  # cortex of another head
    lower = np.linalg.norm(places - [0, 0, -12], axis=-1) < 10
    tissue = (upper | ring | lower).astype(float)
    brain = np.linalg.norm(places, axis=-1) < 30
    found = hindbrain_region(upper, np.zeros_like(upper), brain, tissue)
    assert found[lower].mean() > 0.98
    assert not found[upper].any()
    assert found[ring].mean() < 0.02
    with pytest.raises(ValueError, match="no voxel of the brain lies 7 voxels below"):
        hindbrain_region(upper, np.zeros_like(upper), upper | ring, tissue)


@pytest.fixture(scope="module")
def box() -> Volume:
    """Part of the grid of MNI152, around the fourth ventricle and the thalamus."""
    affine = np.eye(4)
    affine[:3, 3] = -40, -75, -50
    return Volume(np.zeros((81, 80, 75), dtype=np.uint8), affine)


def test_without_deformation_the_average_comes_back(box):
    tissue, empty = template_tissue(), np.zeros(box.data.shape)
    found = CarriedHead(STILL, TO_MNI).added_to({"white": empty, "grey": empty}, empty, box)
    corner = np.round(box.affine[:3, 3] - tissue.hindbrain.affine[:3, 3]).astype(int)
    part = tuple(slice(a, a + n) for a, n in zip(corner, box.data.shape, strict=True))
    np.testing.assert_allclose(found["hindbrain white"], tissue.hindbrain_white.data[part], atol=1e-4)
    np.testing.assert_allclose(found["hindbrain grey"], tissue.hindbrain_grey.data[part], atol=1e-4)
    together = found["hindbrain white"] + found["hindbrain grey"] + found["fluid"]
    np.testing.assert_allclose(together, tissue.hindbrain.data[part], atol=1e-4)
    assert not found["deep grey"].any()  # there is no white matter to lie in


def test_what_is_inside_replaces_white_matter_only_below_its_surface(box):
    white, none = np.ones(box.data.shape), np.zeros(box.data.shape)
    white[:, :, :40] = 0
    found = CarriedHead(STILL, TO_MNI).added_to({"white": white, "grey": none}, white, box)
    np.testing.assert_allclose(sum(found.values())[:, :, 40:], 1, atol=1e-9)
    assert found["deep grey"][:, :, 45:].sum() > 5000
    assert not found["deep grey"][:, :, :42].any()  # within 3 mm of the border
    assert not found["hindbrain grey"][:, :, 40:].any()
    sizes = [
        CarriedHead(STILL, TO_MNI, ventricles=size).added_to({"white": white, "grey": none}, white, box)["fluid"].sum()
        for size in (0.0, 1.0, 1.5)
    ]
    assert sizes[1] - sizes[0] > 2000
    assert sizes[2] > 1.5 * sizes[1]


def test_the_head_moves_with_its_warp(box):
    none = np.zeros(box.data.shape)
    moved = np.eye(4)
    moved[:3, 3] = 0.0, 4.0, 0.0
    first = CarriedHead(STILL, TO_MNI).added_to({"white": none, "grey": none}, none, box)["hindbrain grey"]
    other = CarriedHead(STILL, moved @ TO_MNI).added_to({"white": none, "grey": none}, none, box)["hindbrain grey"]
    np.testing.assert_allclose(other[:, 4:], first[:, :-4], atol=1e-3)
    larger = HeadWarp(torch.full((3,), 1.1, dtype=torch.float64), None)
    ends = [CarriedHead(warp, np.eye(4)).ends() for warp in (STILL, larger)]
    torch.testing.assert_close(ends[1], 1.1 * ends[0])


def test_leaves_change_the_cerebellum_and_not_the_brainstem(box):
    none = np.zeros(box.data.shape)
    make = [CarriedHead(STILL, TO_MNI, leaves=leaves, seed=3) for leaves in (None, Leaves())]
    smooth, leafy = (head.added_to({"white": none, "grey": none}, none, box) for head in make)
    total = [sum(found.values()) for found in (smooth, leafy)]
    np.testing.assert_allclose(*total, atol=1e-9)
    changed = np.abs(smooth["hindbrain grey"] - leafy["hindbrain grey"]) > 0.2
    where = np.argwhere(changed) + box.affine[:3, 3]
    assert changed.sum() > 20_000
    assert not ((np.abs(where[:, 0]) < 17) & (where[:, 1] > -43)).any()


def test_a_subject_without_a_warp_is_refused():
    ball = {side: icosphere(2, 30.0, centre=(x, 0.0, 0.0)) for side, x in (("left", -40.0), ("right", 40.0))}
    wall = {side: torch.zeros(len(mesh.vertices), dtype=torch.bool) for side, mesh in ball.items()}
    larger = {side: mesh.with_vertices(1.01 * mesh.vertices) for side, mesh in ball.items()}
    appearance = Appearance(dict.fromkeys(TISSUES, 100.0))
    with pytest.raises(ValueError, match="the subject has no warp"):
        simulated_scan(CorticalSurfaces(ball, larger, wall), Anatomy(leaf_mm=4.0), appearance, Position(), [0])
    refuses(r"below is 0\.9; with leaf_mm", Anatomy, below=0.9, leaf_mm=4.0)


def arc(radius: float, degrees: float, n: int) -> np.ndarray:
    """Points on an arc behind the fan, in the plane of the midline."""
    angles = np.radians(np.linspace(-degrees / 2, degrees / 2, n))
    return np.array(FAN_MM) + np.stack([0 * angles, -radius * np.cos(angles), radius * np.sin(angles)], axis=1)


@pytest.fixture
def flat(monkeypatch):
    """No waves."""
    monkeypatch.setattr(module, "_WAVES_MM", 0.0)


def test_fissures_are_one_width_apart_and_as_wide_as_they_should_be(flat):
    places = arc(32.0, 120.0, 200_001)
    length = 32.0 * np.radians(120.0)
    found, white = leaf_fractions(places, np.full(len(places), 4.0), Leaves(4.0, 9.0, 0.5, 1.0), 1e-6, 0)
    assert (np.diff((found > 0.5).astype(int)) == 1).sum() in (int(length / 4), int(length / 4) + 1)
    assert found.mean() == pytest.approx(0.5 / 4, rel=0.05)
    assert white.mean() == pytest.approx((4 - 0.5 - 2 * 1.0) / 4, rel=0.05)
    assert not (found * white).any()


def test_leaves_become_narrower_towards_the_middle(flat):
    counts = []
    for radius in (32.0, 16.0):
        places = arc(radius, 120.0, 100_001)
        found, _ = leaf_fractions(places, np.full(len(places), 2.0), Leaves(), 1e-6, 0)
        counts.append((np.diff((found > 0.5).astype(int)) == 1).sum())
    assert counts[0] == counts[1]  # the same leaves, on half the length


def test_fissures_end_at_their_depth_and_the_outer_surface_is_grey(flat):
    places = arc(30.0, 100.0, 20_001)
    for depth, fluid, white in ((12.0, 0, 0), (0.5, 1, 0), (5.0, 1, 1)):
        found = leaf_fractions(places, np.full(len(places), depth), Leaves(depth=9.0), 1e-6, 0)
        assert [part.any() for part in found] == [bool(fluid), bool(white)]


def test_waves_shift_the_leaves_and_the_seed_repeats():
    places = np.random.default_rng(0).uniform(-20, 20, (5000, 3)) + np.array(FAN_MM) - [0, 25, 0]
    depths = np.full(5000, 3.0)
    one, other, third = (leaf_fractions(places, depths, Leaves(), 1.0, seed)[0] for seed in (1, 1, 2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, third)
    assert [part.shape for part in leaf_fractions(places[:0], depths[:0], Leaves(), 1.0, 1)] == [(0,), (0,)]


@pytest.mark.parametrize("sizes", [{"width": 0.0}, {"depth": -1.0}, {"fissure": np.nan}, {"width": 2.0, "cortex": 1.0}])
def test_impossible_leaves_are_refused(sizes):
    refuses("is not possible: sizes are > 0", Leaves, **sizes)
