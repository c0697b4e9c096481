"""The watershed: regions meet at the highest ground, and everything in the mask is divided."""

import numpy as np
import pytest

from meshot.volume.surfaces import watershed_regions


def test_two_markers_meet_at_the_ridge():
    height = np.zeros((21, 5, 5))
    height[13] = 1.0  # not in the middle
    markers, mask = np.zeros(height.shape, dtype=int), np.ones(height.shape, dtype=bool)
    markers[0], markers[20] = 3, 7
    mask[:, 0] = False
    found = watershed_regions(height, markers, mask)
    assert (found[:13, 1:] == 3).all()
    assert (found[14:, 1:] == 7).all()
    assert np.isin(found[13, 1:], (3, 7)).all()
    assert not found[:, 0].any()


def test_what_cannot_be_flooded_is_refused():
    ones = np.ones((3, 3, 3))
    with pytest.raises(ValueError, match="markers has no positive value"):
        watershed_regions(ones, np.zeros(ones.shape, dtype=int), ones > 0)
    with pytest.raises(ValueError, match=r"height ranges from 2 to 2; \[0, 1\] is needed"):
        watershed_regions(2 * ones, ones.astype(int), ones > 0)
