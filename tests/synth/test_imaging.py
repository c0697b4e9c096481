"""Images made from spheres, whose tissue is known in closed form."""

import dataclasses
import functools
import math

import numpy as np
import pytest

from meshot.mesh.shapes import icosphere
from meshot.synth.imaging import (
    TISSUES,
    Appearance,
    rician_noise,
    smooth_noise,
    t1_image,
    tissue_fractions,
    with_motion,
)
from meshot.volume.volume import Volume

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
    with pytest.raises(ValueError, match="signal names"):
        Appearance({"white": 1.0})
    with pytest.raises(ValueError, match="not possible"):
        dataclasses.replace(PLAIN, noise=-1.0)
    with pytest.raises(ValueError, match="three thicknesses"):
        tissue_fractions([icosphere(1)], [icosphere(1, 2.0)], GRID, (1.0, 2.0))


def test_gamma_bends_the_signal_below_the_largest_mean():
    point = {tissue: np.zeros(GRID.data.shape) for tissue in TISSUES}
    point["white"][:], point["grey"][:] = 0.25, 0.75
    plain = {"signal": dict.fromkeys(TISSUES, 0.0) | {"white": 400.0, "grey": 200.0}, "texture": 0.0, "bias": 0.0}
    plain |= {"blur_mm": 0.0, "noise": 0.0}
    for gamma in (None, 0.5, 2.0):
        image = t1_image(point, GRID, Appearance(**plain, gamma=gamma), 0).data
        assert image == pytest.approx(400 * (250 / 400) ** (gamma or 1.0), rel=1e-5)
    with pytest.raises(ValueError, match="lengths and gamma > 0"):
        Appearance(**plain, gamma=0.0)


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
    with pytest.raises(ValueError, match="white_gradient is between 0 and 1"):
        dataclasses.replace(PLAIN, white_gradient=1.5)
