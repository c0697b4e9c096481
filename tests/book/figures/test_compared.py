"""Slices that compare found surfaces with the true one: both lines in every panel, told apart without colour."""

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot.mesh.shapes import icosphere
from meshot.volume.volume import Volume
from meshot_book.figures.cortex.compared import compared_slices

AFFINE = np.diag([1.0, 1.0, 1.0, 1.0])
AFFINE[:3, 3] = -9.5
SCAN = Volume(np.full((20, 20, 20), 0.5), AFFINE)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_every_panel_has_a_thick_true_and_a_thin_found_line():
    found = {"near": icosphere(2, 5.5), "far": icosphere(2, 8.0), "small": icosphere(2, 2.0)}
    figure = compared_slices(SCAN, icosphere(2, 5.0), found, "coronal", 0.1, {"A": (0.0, 6.0)})
    panels = [ax for ax in figure.axes if ax.images]
    assert [ax.get_title() for ax in panels] == list(found)
    for ax, radius in zip(panels, (5.5, 8.0, 2.0)):
        true, line = ax.collections
        assert true.get_linewidth()[0] > 2 * line.get_linewidth()[0]
        for drawn, wanted in ((true, 5.0), (line, radius)):
            ends = np.concatenate([path.vertices for path in drawn.get_paths()])
            assert np.hypot(*ends.T).max() == pytest.approx(wanted, rel=0.03)
        assert [text.get_text() for text in ax.texts] == ["A"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["true", "found"]


def test_an_unknown_plane_or_no_surface_is_refused():
    with pytest.raises(ValueError, match="plane is 'oblique', of 1 surfaces; one of axial"):
        compared_slices(SCAN, icosphere(1), {"a": icosphere(1)}, "oblique", 0.0)
    with pytest.raises(ValueError, match="of 0 surfaces"):
        compared_slices(SCAN, icosphere(1), {}, "axial", 0.0)
