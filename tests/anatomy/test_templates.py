"""What comes with nilearn's wheel, and that nothing is fetched."""

import socket

import numpy as np
import pytest

from meshot.anatomy.templates import (
    fsaverage5_surface,
    mni152_brain_mask,
    mni152_grey_matter,
    mni152_t1,
    mni152_white_matter,
)
from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import signed_volume
from meshot.volume.volume import voxel_sizes


@pytest.fixture(autouse=True)
def no_network(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("something touched the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    with pytest.raises(AssertionError, match="network"):
        socket.create_connection(("example.org", 80))


def test_the_average_at_one_millimetre():
    t1, white, grey, brain = mni152_t1(), mni152_white_matter(), mni152_grey_matter(), mni152_brain_mask()
    for volume in (t1, white, grey, brain):
        assert volume.data.shape == (197, 233, 189)
        assert np.array_equal(volume.affine, t1.affine)
    assert voxel_sizes(t1).tolist() == [1, 1, 1]
    assert (t1.data.min(), t1.data.max()) == (0, 1)
    assert brain.data.dtype == bool
    # 1.9 litres of brain, a third of it white: an average of many heads in MNI space is large.
    assert brain.data.sum() == pytest.approx(1.88e6, rel=0.02)
    assert 0.4e6 < (white.data > 0.5).sum() < 0.8e6
    assert t1.data[white.data > 0.9].mean() > t1.data[grey.data > 0.9].mean()


@pytest.mark.parametrize("hemisphere", ["left", "right"])
def test_the_surfaces_are_spheres_of_the_right_side(hemisphere):
    white, pial = (fsaverage5_surface(kind, hemisphere) for kind in ("white", "pial"))
    assert topology(white) == topology(pial) == SPHERE
    assert len(white.vertices) == 10_242
    assert 0 < float(signed_volume(white)) < float(signed_volume(pial))
    assert (float(white.vertices[:, 0].mean()) < 0) == (hemisphere == "left")


@pytest.mark.parametrize(("kind", "side"), [("inner", "left"), ("white", "both")])
def test_other_surfaces_do_not_exist(unchecked, kind, side):
    with pytest.raises(ValueError, match="no surface"):
        fsaverage5_surface(kind, side)
