"""The inside of the average: found where atlases have it, and carried with the cortex."""

import numpy as np
import pytest
import torch

from meshot.anatomy.templates import MNI305_TO_MNI152
from meshot.mesh.shapes import icosphere
from meshot.synth.heads import CarriedHead, Leaves, hindbrain_region, template_tissue
from meshot.synth.imaging import TISSUES, Appearance
from meshot.synth.scanning import Anatomy, Position, simulated_scan
from meshot.synth.subject import CorticalSurfaces, HeadWarp
from meshot.volume.volume import Volume

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
    with pytest.raises(ValueError, match=r"below is 0\.9; with leaf_mm"):
        Anatomy(below=0.9, leaf_mm=4.0)
