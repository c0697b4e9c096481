"""Scans that show no whole adult brain in the contrast of a T1: each is doubted by name."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, gaussian_filter

from meshot.pipeline.quality import gap_in, scan_warnings, volume_warnings
from meshot.volume.registration import centre_of_mass, place_on_grid, standard_scan
from meshot.volume.volume import Volume

SIZE, SHAPE = 6.0, (34, 40, 32)
RADII_MM = (66.0, 84.0, 62.0)  # 1440 cm³


def brain() -> Volume:
    """An ellipsoid of the size of a brain with a texture that no turn and no half of it shares."""
    affine = np.diag([SIZE, SIZE, SIZE, 1.0])
    affine[:3, 3] = -SIZE * (np.array(SHAPE) - 1) / 2
    places = np.indices(SHAPE) - (np.array(SHAPE)[:, None, None, None] - 1) / 2
    inside = ((places * SIZE / np.array(RADII_MM)[:, None, None, None]) ** 2).sum(axis=0) < 1
    texture = gaussian_filter(np.random.default_rng(1).standard_normal(SHAPE), 1.2)
    values = np.clip(150 + 60 * texture / texture.std(), 40, 255)
    return Volume(np.where(inside, values, 0).astype(np.float32), affine)


HEAD = brain()
INSIDE = HEAD.data > 0


def shell(first: int, last: int) -> np.ndarray:
    """The voxels around the brain from the first to the last layer."""
    return binary_dilation(INSIDE, iterations=last) & ~binary_dilation(INSIDE, iterations=first)


def angiogram() -> np.ndarray:
    """Bright tubes from front to back in a dim brain."""
    tubes = np.zeros(SHAPE, dtype=bool)
    tubes[::5, :, ::5] = True
    return np.where(INSIDE, np.where(tubes, 900, 60 + 0.05 * HEAD.data), 0)


def tomogram() -> np.ndarray:
    """In Hounsfield units: a brain with hardly a contrast, and bone around it."""
    data = np.where(INSIDE, 34 - 0.02 * HEAD.data, -1000)
    return np.where(shell(1, 3), 900, data)


#: What is brought, and by which names it is doubted.
BAD = {
    "noise": (lambda: np.abs(np.random.default_rng(2).normal(0, 10, SHAPE)), {"agreement", "contrast"}),
    "angiogram": (angiogram, {"bright_volume", "contrast"}),
    "tomogram": (tomogram, {"contrast"}),
    "mask": (lambda: INSIDE.astype(float), {"few_values"}),
    "skull": (lambda: np.where(shell(1, 3), 220, HEAD.data), {"bright_volume"}),
    "inverted": (lambda: np.where(INSIDE, 280 - HEAD.data, 0), {"contrast"}),
    "upside down": (lambda: HEAD.data[:, :, ::-1], {"contrast"}),
}


def doubts(scan: Volume, registered: bool = True) -> set[str]:
    """The names of all warnings before a network sees the scan, which is registered or taken to lie where HEAD does."""
    if registered:
        placed = standard_scan(scan, HEAD, quick=True)
    else:
        placed = place_on_grid(scan, np.eye(4), centre_of_mass(HEAD))
    return {warning.name for warning in volume_warnings(scan) + scan_warnings(placed, HEAD)}


def test_a_whole_brain_in_another_place_is_not_doubted():
    moved = HEAD.affine.copy()
    moved[:3, 3] += [12, -8, 20]
    noise = np.where(INSIDE, np.random.default_rng(3).normal(0, 6, SHAPE), 0)
    assert doubts(Volume(HEAD.data + noise, moved)) == set()


@pytest.mark.parametrize("name", BAD)
def test_the_doubt_is_named(name):
    make, expected = BAD[name]
    assert doubts(HEAD.with_data(np.asarray(make(), dtype=np.float32)), registered=False) >= expected


def test_half_a_brain_and_the_brain_of_a_foetus_are_doubted():
    kept = np.arange(SHAPE[0])[:, None, None] < SHAPE[0] / 2
    assert doubts(HEAD.with_data(np.where(kept, HEAD.data, 0))) & {"bright_volume", "stretch"}
    small = HEAD.affine.copy()
    small[:3] *= 0.45
    assert "bright_volume" in doubts(Volume(HEAD.data, small))


def test_a_field_of_view_that_ends_inside_the_brain_is_doubted():
    def without_the_lowest(n: int) -> set[str]:
        """Of a brain that fills 18 layers of 6 mm between its rims."""
        return doubts(HEAD.with_data(np.where(np.arange(SHAPE[2]) < 5 + n, 0, HEAD.data)), registered=False)

    assert "gap" not in without_the_lowest(0)
    assert "gap" in without_the_lowest(8)


def test_a_gap_is_measured_in_mm3():
    cut, even = HEAD.data.copy(), HEAD.with_data(INSIDE.astype(np.float32))
    cut[15:18, 18:21, 15:17] = 0
    assert gap_in(HEAD, even) == 0
    assert gap_in(HEAD.with_data(cut), even) == pytest.approx(3 * 3 * 2 * SIZE**3)
    assert gap_in(HEAD, HEAD.with_data(np.zeros(SHAPE))) == 0  # a template without a brain
