"""Images made from spheres and ellipsoids, whose tissue is known, and their blemishes."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshot.mesh.shapes import icosphere
from meshot.synth.imaging import (
    DEPTH_MM,
    TISSUES,
    Appearance,
    Blemishes,
    Structure,
    add_structures,
    blemished,
    moved_structure,
    rician_noise,
    smooth_noise,
    structure_fraction,
    structures_of,
    t1_image,
    tissue_fractions,
    with_motion,
)
from meshot.volume.volume import Volume
from refusals import refuses

SIGNAL = {
    "white": 110.0,
    "grey": 80.0,
    "deep grey": 95.0,
    "hindbrain": 90.0,
    "fluid": 30.0,
    "skull": 15.0,
    "scalp": 120.0,
}
PLAIN = Appearance(SIGNAL, texture=0.0, bias=0.0, blur_mm=0.0, noise=0.0)
SHELLS = [tissue for tissue in TISSUES if tissue not in ("deep grey", "hindbrain")]
GRID = Volume(np.zeros((64, 60, 62)), np.diag([1.0, 1.0, 1.0, 1.0]))
CENTRE = (31.0, 30.0, 30.0)


@functools.cache
def fractions(head=(2.0, 3.0, 4.0)):
    return tissue_fractions([icosphere(5, 12.0, CENTRE)], [icosphere(5, 15.0, CENTRE)], GRID, head)


def ball(radius):
    return 4 / 3 * math.pi * radius**3


def test_tissue_has_its_volume_and_fills_the_head():
    found = fractions()
    assert tuple(found) == TISSUES
    volumes = [found[tissue].sum() for tissue in SHELLS]
    assert found["deep grey"].max() == found["hindbrain"].max() == 0
    ends = [0, 12, 15, 17, 20, 24]
    np.testing.assert_allclose(volumes[:2], np.diff([ball(r) for r in ends[:3]]), rtol=5e-3)
    np.testing.assert_allclose(volumes[2:], np.diff([ball(r) for r in ends[2:]]), rtol=0.1)
    total = sum(found.values())
    assert total.max() <= 1 + 1e-9
    radius = np.linalg.norm(np.argwhere(total > -1) - CENTRE, axis=1).reshape(total.shape)
    np.testing.assert_allclose(total[radius < 22], 1, atol=1e-9)
    assert (total[radius > 26] == 0).all()


def test_without_a_head_there_is_fluid_only_in_narrow_gaps():
    gap = [icosphere(4, 8.0, (22.0, 30.0, 30.0)), icosphere(4, 8.0, (40.0, 30.0, 30.0))]  # 2 mm apart
    found = tissue_fractions([icosphere(3, 5.0, (22.0, 30.0, 30.0))], gap, GRID)
    assert found["fluid"][31, 30, 30] == 1
    assert found["fluid"][22, 41, 30] == 0
    assert found["skull"].max() == found["scalp"].max() == 0


def test_pure_voxels_show_the_signal_of_their_tissue():
    image = t1_image(fractions(), GRID, PLAIN, 0).data
    for tissue in SHELLS:
        pure = fractions()[tissue] > 1 - 1e-9
        assert pure.any()
        np.testing.assert_allclose(image[pure], SIGNAL[tissue], rtol=1e-6)
    half = t1_image({t: 0.5 * f for t, f in fractions().items()}, GRID, PLAIN, 0).data
    np.testing.assert_allclose(half, image / 2, rtol=1e-6)


def test_each_knob_does_what_it_says():
    inner = fractions()["white"] > 1 - 1e-9
    textured = t1_image(fractions(), GRID, dataclasses.replace(PLAIN, texture=0.05), 0).data[inner] / 110
    assert textured.std() == pytest.approx(0.05, rel=0.2)
    biased = t1_image(fractions(), GRID, dataclasses.replace(PLAIN, bias=0.2, bias_mm=6.0), 0).data[inner] / 110
    assert np.log(biased).std() == pytest.approx(0.2, rel=0.25)
    long = t1_image(fractions(), GRID, dataclasses.replace(PLAIN, bias=0.2), 0).data[22:40, 30, 30]
    assert np.abs(np.diff(np.log(long))).max() < 0.02
    noisy = t1_image(fractions(), GRID, dataclasses.replace(PLAIN, noise=4.0), 0).data
    assert noisy[inner].std() == pytest.approx(4, rel=0.05)
    air = sum(fractions().values()) == 0
    assert noisy[air].mean() == pytest.approx(4 * math.sqrt(math.pi / 2), rel=0.02)


def test_the_point_spread_has_its_width():
    point = {tissue: np.zeros(GRID.data.shape) for tissue in TISSUES}
    point["white"][30, 30, 30] = 1
    spread = t1_image(point, GRID, dataclasses.replace(PLAIN, blur_mm=4.0), 0).data
    assert spread[32, 30, 30] / spread[30, 30, 30] == pytest.approx(0.5, rel=1e-3)  # half of it, half a width away
    assert spread.sum() == pytest.approx(110, rel=1e-4)


def test_rician_moments():
    for signal in (0.0, 1.0, 10.0):
        drawn = rician_noise(np.full(400_000, signal), 2.0, 0)
        assert (drawn**2).mean() == pytest.approx(signal**2 + 2 * 2.0**2, rel=0.01)  # E M² = A² + 2σ²


def test_smooth_noise_is_smooth_over_its_length():
    field = smooth_noise((90, 80, 70), np.array([8.0, 8.0, 8.0]), 1)
    assert (field.mean(), field.std()) == (pytest.approx(0, abs=1e-12), pytest.approx(1))

    def correlation(lag):
        return np.mean(field[lag:] * field[: len(field) - lag])

    assert correlation(1) > 0.95
    assert abs(correlation(24)) < 0.2
    np.testing.assert_array_equal(field, smooth_noise((90, 80, 70), np.array([8.0, 8.0, 8.0]), 1))


def test_doors():
    refuses("signal names", Appearance, {"white": 1.0})
    refuses("not possible", dataclasses.replace, PLAIN, noise=-1.0)
    refuses("three thicknesses", tissue_fractions, [icosphere(1)], [icosphere(1, 2.0)], GRID, (1.0, 2.0))


def test_gamma_bends_the_signal_below_the_largest_mean():
    point = {tissue: np.zeros(GRID.data.shape) for tissue in TISSUES}
    point["white"][:], point["grey"][:] = 0.25, 0.75
    plain = {"signal": dict.fromkeys(TISSUES, 0.0) | {"white": 400.0, "grey": 200.0}, "texture": 0.0, "bias": 0.0}
    plain |= {"blur_mm": 0.0, "noise": 0.0}
    for gamma in (None, 0.5, 2.0):
        image = t1_image(point, GRID, Appearance(**plain, gamma=gamma), 0).data
        assert image == pytest.approx(400 * (250 / 400) ** (gamma or 1.0), rel=1e-5)
    refuses("lengths and gamma > 0", Appearance, **plain, gamma=0.0)


def test_motion_keeps_the_mean_and_does_nothing_without_displacement():
    signal = np.random.default_rng(0).uniform(1, 2, (24, 20, 18))
    np.testing.assert_allclose(with_motion(signal, np.zeros(3), 1), signal, rtol=1e-12)
    moved = with_motion(signal, np.full(3, 0.5), 1)
    assert moved.mean() == pytest.approx(signal.mean(), rel=0.02)
    assert 0.01 < np.abs(moved - signal).mean() < 0.4
    np.testing.assert_array_equal(moved, with_motion(signal, np.full(3, 0.5), 1))


def test_sulci_are_filled_up_to_a_width():
    meshes = [icosphere(3, radius=14.0, centre=(x, 0.0, 0.0)) for x in (-19.0, 19.0)]  # 10 mm apart
    affine = np.diag([1.0, 1.0, 1.0, 1.0])
    affine[:3, 3] = -36, -18, -18
    grid = Volume(np.zeros((73, 37, 37)), affine)
    middle = {
        sulci: tissue_fractions(meshes, meshes, grid, sulci_mm=sulci)["fluid"][36, 18, 18] for sulci in (4.0, 14.0)
    }
    assert middle == {4.0: 0.0, 14.0: 1.0}


def test_white_matter_is_darker_only_right_below_the_cortex():
    radius = np.linalg.norm(np.indices(GRID.data.shape).transpose(1, 2, 3, 0) - CENTRE, axis=-1)
    tissue, sharp = fractions(), dataclasses.replace(PLAIN, blur_mm=0.0)
    plain = t1_image(tissue, GRID, sharp, 0).data.astype(float)
    change = t1_image(tissue, GRID, dataclasses.replace(sharp, white_gradient=0.4), 0).data - plain
    step = PLAIN.signal["white"] - PLAIN.signal["grey"]
    below = (radius > 10.8) & (radius < 11.2) & (tissue["white"] == 1)
    # One standard deviation from a flat border 2 Φ(−1) = 0.317 of the gradient is left.
    assert change[below].mean() == pytest.approx(-0.4 * 0.317 * step, rel=0.25)
    assert np.abs(change[radius < 7]).max() < 0.01 * step
    assert np.abs(change[tissue["white"] == 0]).max() == 0
    assert change.max() <= 0
    refuses("white_gradient is between 0 and 1", dataclasses.replace, PLAIN, white_gradient=1.5)


N = 64
BLEMISHES_GRID = Volume(np.zeros((N, N, N), dtype=np.uint8), np.diag([1.5, 1.5, 1.5, 1.0]))
RADIUS = np.linalg.norm(1.5 * (np.stack(np.meshgrid(*(np.arange(N),) * 3, indexing="ij"), axis=-1) - N / 2), axis=-1)


def head() -> dict[str, np.ndarray]:
    """White matter within 25 mm, grey matter to 30, fluid to 33."""
    found = {tissue: np.zeros((N, N, N)) for tissue in TISSUES}
    found["white"][RADIUS < 25] = 1
    found["grey"][(RADIUS >= 25) & (RADIUS < 30)] = 1
    found["fluid"][(RADIUS >= 30) & (RADIUS < 33)] = 1
    return found


def changed(blemishes: Blemishes, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
    before, after = head(), blemished(head(), BLEMISHES_GRID, blemishes, seed)
    assert all(part.min() >= -1e-9 and part.max() <= 1 + 1e-9 for part in after.values())
    assert sum(after.values()).max() <= 1 + 1e-9
    return after, sum(np.abs(after[name] - before[name]) for name in before) > 0.1


def test_a_perfect_scan_has_none():
    assert not changed(Blemishes())[1].any()


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_dura_covers_its_share_of_the_outer_surface(share):
    after, where = changed(Blemishes(dura=share, dura_mm=4.0))
    assert where[(RADIUS > 34) & (RADIUS < 36)].mean() == pytest.approx(share, abs=0.12)
    assert not where[(RADIUS < 33) | (RADIUS > 39)].any()
    assert after["scalp"][where].min() == 1


def test_cuts_remove_everything_to_their_depth():
    after, where = changed(Blemishes(cut=0.3, cut_mm=6.0))
    assert sum(after.values())[where].max() == 0
    assert where[(RADIUS > 29) & (RADIUS < 32)].mean() == pytest.approx(0.3, abs=0.12)
    assert not where[RADIUS < 25].any()


def test_lesions_lie_deep_in_white_matter_with_their_share():
    after, where = changed(Blemishes(lesions=0.1))
    assert not where[RADIUS > 23.5].any()
    assert after["deep grey"][RADIUS < 20].mean() == pytest.approx(0.1, abs=0.05)


def test_vessels_stay_near_the_surface_and_are_thin():
    after, where = changed(Blemishes(vessels=5))
    assert not where[(RADIUS < 28) | (RADIUS > 43)].any()
    volume = after["scalp"].sum() * 1.5**3
    assert 5 * 60 * np.pi * 0.5**2 / 2 < volume < 5 * 60 * np.pi * 1.5**2 * 2.5


def test_the_seed_decides():
    kinds = Blemishes(dura=0.2, cut=0.2, vessels=2, lesions=0.1)
    one, other, third = (changed(kinds, seed)[1] for seed in (1, 1, 2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, third)


@pytest.mark.parametrize(
    ("sizes", "words"),
    [({"dura": 1.5}, "dura is 1.5; a share"), ({"cut": -0.1}, "cut is -0.1"), ({"vessels": -1}, "not possible")],
)
def test_impossible_sizes_are_refused(sizes, words):
    refuses(words, Blemishes, **sizes)


def test_an_empty_scan_is_refused():
    with pytest.raises(ValueError, match="contain no brain"):
        blemished({tissue: np.zeros((4, 4, 4)) for tissue in TISSUES}, BLEMISHES_GRID, Blemishes(dura=0.1), 0)


STRUCTURES_GRID = Volume(
    np.zeros((60, 56, 50)), np.array([[-1.0, 0, 0, 30], [0, 1, 0, -28], [0, 0, 1.2, -30], [0, 0, 0, 1]])
)
TURN = np.eye(4)
TURN[:3, :3] = Rotation.from_euler("xyz", [20, -30, 40], degrees=True).as_matrix()
TURN[:3, 3] = [3.0, -2.0, 4.0]


def places():
    index = np.stack(np.meshgrid(*map(np.arange, STRUCTURES_GRID.data.shape), indexing="ij"), axis=-1)
    return index @ STRUCTURES_GRID.affine[:3, :3].T + STRUCTURES_GRID.affine[:3, 3]


def test_an_ellipsoid_has_its_volume_and_its_place():
    upright = Structure("fluid", np.zeros(3), np.diag([6.0, 9.0, 12.0]), True)
    for structure in (upright, moved_structure(upright, TURN)):
        box, part = structure_fraction(structure, STRUCTURES_GRID)
        assert part.sum() * 1.2 == pytest.approx(4 / 3 * np.pi * 6 * 9 * 12, rel=0.02)
        inside = np.linalg.norm((places()[box] - structure.centre_mm) @ np.linalg.inv(structure.axes_mm).T, axis=-1) < 1
        assert (part[inside] > 0.5 - 1e-9).all()
        assert (part[~inside] < 0.5 + 1e-9).all()
    np.testing.assert_allclose(moved_structure(upright, TURN).centre_mm, TURN[:3, 3])


def test_an_ellipsoid_beyond_the_grid_fills_nothing():
    box, part = structure_fraction(Structure("fluid", np.full(3, 500.0), np.eye(3), True), STRUCTURES_GRID)
    assert part.size == 0 or part.max() == 0
    assert np.zeros(STRUCTURES_GRID.data.shape)[box].shape == part.shape


def test_inner_structures_stay_below_the_surface_and_outer_ones_outside():
    radius = np.linalg.norm(places(), axis=-1)
    white, pial = (np.clip(r + 0.5 - radius, 0, 1) for r in (15.0, 18.0))
    inner = Structure("deep grey", np.array([12.0, 0, 0]), 6 * np.eye(3), True)
    outer = Structure("hindbrain", np.array([0, 0, -18.0]), 8 * np.eye(3), False)
    found = add_structures({"white": white, "grey": pial - white}, pial, STRUCTURES_GRID, [inner, outer])
    total = sum(found.values())
    np.testing.assert_allclose(total[radius < 17], 1, atol=1e-12)
    assert total.max() <= 1 + 1e-12
    deep = found["deep grey"] > 0.5
    assert deep.any()
    assert radius[deep].max() < 15 - DEPTH_MM + 1.5
    assert radius[found["hindbrain"] > 0.5].min() > 17.4
    assert found["hindbrain"].sum() > 0


def test_later_structures_replace_earlier_ones():
    white = np.ones(STRUCTURES_GRID.data.shape)
    first, second = (Structure(t, np.zeros(3), r * np.eye(3), True) for t, r in (("deep grey", 8), ("fluid", 4)))
    found = add_structures({"white": white, "grey": 0 * white}, white, STRUCTURES_GRID, [first, second])
    middle = np.linalg.norm(places(), axis=-1) < 3
    assert (found["fluid"][middle] == 1).all()
    assert (found["deep grey"][middle] == 0).all()


def test_both_sides_are_mirror_images_and_multiples_scale():
    white = {"left": icosphere(2, 30.0, (-31.0, 0, 0)), "right": icosphere(2, 30.0, (31.0, 0, 0))}
    left, right = structures_of(white)[:2]
    np.testing.assert_allclose(left.centre_mm * [-1, 1, 1], right.centre_mm, atol=1e-9)
    assert left.centre_mm[0] > -31  # nearer to the middle of the head than the middle of its hemisphere

    def ventricles(scale):
        return sum(np.linalg.det(s.axes_mm) for s in structures_of(white, ventricles=scale) if s.tissue == "fluid")

    assert ventricles(2.0) == pytest.approx(8 * ventricles(1.0))
    assert ventricles(0.0) == 0
    assert all(s.inside_white for s in structures_of(white, below=0.0))


def test_doors_of_structures():
    refuses("multiples from 0", structures_of, {"left": icosphere(1)}, ventricles=-1.0)
    refuses("multiples from 0", structures_of, {"left": icosphere(1)}, below=4.0)
