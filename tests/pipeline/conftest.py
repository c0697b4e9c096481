"""White matter as a scan, and a segmentation by brightness in place of a network."""

import numpy as np
import pytest

from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from meshot.pipeline import mirror, reconstruction as placing
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume


@pytest.fixture(scope="module")
def brain():
    """The white matter of fsaverage5 as a scan in MNI152 coordinates."""
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = [-90.0, -126.0, -72.0]
    grid = Volume(np.zeros((91, 109, 91)), affine)
    parts = [enclosed_fractions(fsaverage5_surface("white", side, "MNI152"), grid) for side in HEMISPHERES]
    return grid.with_data((parts[0] + parts[1]).astype(np.float32))


def bright(volume):
    """Brighter than half of the white matter, at whatever level that is."""
    return volume.data > 0.5 * np.median(volume.data[volume.data > 0.3])


@pytest.fixture
def looks(monkeypatch):
    """A segmentation by brightness in place of a network. Returns every scan that it saw."""
    seen = []

    def segment(scan, network):
        seen.append(scan)
        x = scan.affine[0, 3] + scan.affine[0, 0] * np.arange(scan.data.shape[0])
        on_the_left = (x < 0.5)[:, None, None]  # of the plane between the hemispheres of fsaverage5
        return {
            side: scan.with_data((bright(scan) & part).astype(np.float32))
            for side, part in zip(HEMISPHERES, (on_the_left, ~on_the_left))
        }

    monkeypatch.setattr(placing, "segment", segment)
    monkeypatch.setattr(mirror, "segment", segment)
    return seen
