"""Slices of several volumes: as many panels, one scale, lines where the surface is."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot.mesh.shapes import icosphere
from meshot.volume.volume import Volume
from meshot_book.figures.cortex.panels import slice_panels


def ramp(scale):
    data = scale * np.broadcast_to(np.arange(10.0)[:, None, None], (10, 8, 12))
    return Volume(data.copy(), np.diag([2.0, 2.0, 2.0, 1.0]))


def test_panels_share_a_scale_and_show_the_slice():
    figure = slice_panels({"one": ramp(1), "two": ramp(2), "three": ramp(3), "four": ramp(4)}, "coronal", 8.0)
    shown = [ax for ax in figure.axes if ax.images]
    assert [ax.get_title() for ax in shown] == ["one", "two", "three", "four"]
    assert {ax.images[0].get_clim() for ax in shown} == {(0.0, 36.0)}
    np.testing.assert_allclose(shown[1].images[0].get_array()[0], 2 * np.arange(10.0))
    assert shown[0].images[0].get_extent() == [-1, 19, -1, 23]
    assert (shown[0].get_ylabel(), shown[3].get_xlabel()) == ("z (mm)", "x (mm)")
    plt.close(figure)


def test_lines_lie_on_the_surface_and_the_bar_has_its_label():
    meshes = {"b": {"ball": icosphere(3, 4.0, (8.0, 8.0, 10.0))}}
    figure = slice_panels({"a": ramp(1), "b": ramp(1)}, "axial", 10.0, meshes, limits=(0, 5), label="signal", columns=2)
    panels = [ax for ax in figure.axes if ax.images]
    assert [len(ax.collections) for ax in panels[:2]] == [0, 1]
    points = np.concatenate(panels[1].collections[0].get_segments())
    np.testing.assert_allclose(np.linalg.norm(points - [8, 8], axis=1), 4, atol=0.1)
    assert "signal" in {ax.get_xlabel() for ax in figure.axes}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["ball"]
    plt.close(figure)


def test_doors():
    with pytest.raises(ValueError, match="of 0 volumes"):
        slice_panels({}, "coronal", 0.0)
    with pytest.raises(ValueError, match="plane is 'frontal'"):
        slice_panels({"a": ramp(1)}, "frontal", 0.0)
