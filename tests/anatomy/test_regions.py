"""The Desikan–Killiany regions on fsaverage5: where they lie, and what FreeSurfer calls and colours them."""

import gzip
from pathlib import Path

import nibabel
import numpy as np
import pytest

import meshot.anatomy
from meshot.anatomy.regions import desikan_killiany
from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from refusals import refuses


@pytest.mark.parametrize("side", HEMISPHERES)
def test_names_and_colours_are_those_of_the_file(side):
    atlas = desikan_killiany(side)
    file = Path(meshot.anatomy.__file__).parent / "assets" / f"desikan_killiany_{side}.label.gii.gz"
    image = nibabel.GiftiImage.from_bytes(gzip.decompress(file.read_bytes()))
    stored = [(each.label, tuple(round(255 * part) for part in each.rgba[:3])) for each in image.labeltable.labels]
    assert stored[1:] == list(zip(atlas.names, atlas.colours, strict=True))[1:]
    assert (stored[0][0], atlas.names[0]) == ("unknown", "unknown")
    keys = [each.key for each in image.labeltable.labels]
    np.testing.assert_array_equal(np.array(keys)[atlas.labels], image.darrays[0].data)
    assert set(atlas.labels) == set(range(35))


@pytest.mark.parametrize("side", HEMISPHERES)
def test_regions_lie_where_their_names_say(side):
    atlas, vertices = desikan_killiany(side), fsaverage5_surface("white", side).vertices.numpy()
    middle = {name: vertices[atlas.labels == k].mean(axis=0) for k, name in enumerate(atlas.names)}
    right, front, up = range(3)
    assert middle["frontalpole"][front] > middle["precentral"][front] > middle["postcentral"][front]
    assert middle["postcentral"][front] > middle["lateraloccipital"][front]
    assert middle["superiorparietal"][up] > middle["insula"][up] > middle["temporalpole"][up]
    assert abs(middle["precuneus"][right]) < abs(middle["supramarginal"][right])
    assert np.sign(middle["insula"][right]) == (-1 if side == "left" else 1)


def test_both_sides_have_the_same_names():
    left, right = (desikan_killiany(side) for side in HEMISPHERES)
    assert left.names == right.names
    sizes = [np.bincount(atlas.labels, minlength=35) for atlas in (left, right)]
    assert (np.abs(sizes[0] / sizes[1] - 1)[1:] < 0.5).all()


def test_other_hemispheres_are_refused(unchecked):
    refuses("there is no hemisphere 'lh'; left or right is needed", desikan_killiany, "lh")
