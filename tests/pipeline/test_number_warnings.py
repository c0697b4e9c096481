"""Warnings where scans are placed by white matter: each limit fires on its side, and stands where it was chosen."""

import dataclasses

import numpy as np
import pytest

from meshot.model.segmentation import SegmentationNetwork
from meshot.pipeline.quality import LIMITS, DoubtfulScanError, number_warnings
from meshot.pipeline.reconstruction import reconstruct
from meshot.provenance import read_results

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


def test_a_reconstruction_is_judged_by_its_numbers(brain, looks):
    network = SegmentationNetwork(2, 1, placement=BY_WHITE)
    found = reconstruct(brain, network, None, template=brain)
    assert [warning.name for warning in found.warnings] == []
    assert len(looks) == 3  # the first time, where it belongs, and there in a mirror
    reconstruct(brain, network, None, template=brain, both_ways=False)
    assert len(looks) == 3 + 2
    thick = dataclasses.replace(brain, affine=brain.affine @ np.diag([1.2, 1.2, 1.2, 1.0]))
    with pytest.raises(DoubtfulScanError, match=r"a voxel has 2\.4 mm.*voxel_size"):
        reconstruct(thick, network, None, template=brain, strict=True)
