"""Warnings where scans are placed by white matter: each limit fires on its side, and stands where it was chosen."""

import dataclasses

import numpy as np
import pytest

from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from meshot.model.segmentation import SegmentationNetwork
from meshot.pipeline import reconstruction
from meshot.pipeline.quality import LIMITS, DoubtfulScanError, number_warnings
from meshot.pipeline.reconstruction import reconstruct
from meshot.provenance import read_results
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume

BY_WHITE = "white matter"
BOUNDED = [(each, end) for each in LIMITS for end in ("low", "high") if np.isfinite(getattr(each, end))]
#: Bounds that no value can pass, and need no text.
ENDS = {("voxel_mm", "low"), ("gap_cm3", "low"), ("given_up", "low"), ("brighter_inside", "high")}


def within() -> dict[str, float]:
    """A number inside each range."""
    return {each.number: each.low if np.isfinite(each.low) else each.high for each in LIMITS}


def test_numbers_on_their_limits_are_usual():
    assert number_warnings(within()) == []
    assert number_warnings({each.number: min(each.high, each.low + 1e6) for each in LIMITS}) == []


@pytest.mark.parametrize(("limit", "end"), BOUNDED, ids=[f"{each.number}-{end}" for each, end in BOUNDED])
def test_each_limit_warns_beyond_it(limit, end):
    bound = getattr(limit, end)
    value = bound + (1 if end == "high" else -1) * max(0.01 * abs(bound), 0.001)
    (found,) = number_warnings(within() | {limit.number: value})
    assert (found.name, found.value) == (limit.warning, value)
    if (limit.number, end) not in ENDS and (bound, end) != (1.0, "low"):
        said = limit.text.format(value=value, low=limit.low, high=limit.high)
        assert found.text == said
        assert "{" not in said
        assert "inf" not in said


def test_what_is_no_number_lies_beyond_every_limit():
    found = number_warnings(dict.fromkeys(within(), float("nan")))
    assert len(found) == len(LIMITS)


def test_the_limits_are_those_that_were_chosen(root):
    chosen = read_results(root / "experiments" / "warnings" / "second" / "results.json")["results"]["limits"]
    assert {each.number for each in LIMITS} == set(chosen)
    for each in LIMITS:
        for mine, end in zip((each.low, each.high), chosen[each.number], strict=True):
            if end is not None:
                assert mine == pytest.approx(end, rel=0.005)


@pytest.fixture(scope="module")
def brain():
    """The white matter of fsaverage5, a little darker outside, as a scan in MNI152 coordinates."""
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = [-90.0, -126.0, -72.0]
    grid = Volume(np.zeros((91, 109, 91)), affine)
    parts = [enclosed_fractions(fsaverage5_surface("white", side, "MNI152"), grid) for side in HEMISPHERES]
    texture = np.random.default_rng(0).normal(0, 0.01, grid.data.shape)
    return grid.with_data(np.clip(sum(parts) + texture, 0, 1).astype(np.float32))


@pytest.fixture
def by_brightness(monkeypatch):
    """A segmentation by brightness in place of a network."""

    def white_matter(scan, network):
        x = scan.volume.affine[0, 3] + scan.volume.affine[0, 0] * np.arange(scan.volume.data.shape[0])
        on_the_left = (x < 0.5)[:, None, None]
        bright = scan.volume.data > 0.5 * np.median(scan.volume.data[scan.volume.data > 0.3])
        return {
            side: scan.volume.with_data((bright & part).astype(np.float32))
            for side, part in zip(HEMISPHERES, (on_the_left, ~on_the_left), strict=True)
        }

    monkeypatch.setattr(reconstruction, "white_matter", white_matter)
    return SegmentationNetwork(2, 1, placement=BY_WHITE)


def test_a_reconstruction_is_judged_by_its_numbers(brain, by_brightness):
    found = reconstruct(brain, by_brightness, None, template=brain)
    assert [warning.name for warning in found.warnings] == []
    thick = dataclasses.replace(brain, affine=brain.affine @ np.diag([1.2, 1.2, 1.2, 1.0]))
    with pytest.raises(DoubtfulScanError, match=r"a voxel has 2\.4 mm.*voxel_size"):
        reconstruct(thick, by_brightness, None, template=brain, strict=True)
