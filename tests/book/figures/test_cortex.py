"""Pictures of slices, networks and systems: everything is said, and what is drawn is what was given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from meshot.mesh.shapes import icosphere
from meshot.model.deformation import DeformationNetwork
from meshot.systems import get_system, read_settings
from meshot.volume.volume import Volume
from meshot_book.figures.cortex.panels import compared_slices, slice_panels
from meshot_book.figures.cortex.systems import SystemStep, network_boxes, network_figure, system_figure, system_steps

AFFINE = np.diag([1.0, 1.0, 1.0, 1.0])


AFFINE[:3, 3] = -9.5


SCAN = Volume(np.full((20, 20, 20), 0.5), AFFINE)


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


@pytest.fixture(params=[(8, (16,), 2, 3), (4, (6, 5, 7), 1, 3)])
def network(request):
    return DeformationNetwork(*request.param)


def test_the_boxes_add_up(network):
    boxes = network_boxes(network)
    assert sum(learned for branch in boxes.values() for *_, learned in branch) == network.n_parameters


def test_shapes_are_those_that_leave_a_layer(network):
    boxes = network_boxes(network)
    width = network.config()["width"]
    assert boxes["position"][-1][1] == boxes["image"][-1][1] == str(width)
    assert boxes["joined"][0][1] == str(2 * width)
    points, features = torch.zeros(5, 3).double(), torch.zeros(5, width).double()
    assert boxes["joined"][-1][1] == str(network(points, features).shape[1])


def test_everything_is_written(network):
    (ax,) = network_figure(network).axes
    said = [text.get_text() for text in ax.texts]
    for branch in network_boxes(network).values():
        for what, shape, learned in branch:
            assert {what, f"→ {shape}"} <= set(said)
            assert not learned or f"learns {learned:,}".replace(",", " ") in said
    assert f"learned in all: {network.n_parameters:,}".replace(",", " ") in said


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


def test_lines_lie_on_the_surface_and_the_bar_has_its_label():
    meshes = {"b": {"ball": icosphere(3, 4.0, (8.0, 8.0, 10.0))}}
    figure = slice_panels({"a": ramp(1), "b": ramp(1)}, "axial", 10.0, meshes, limits=(0, 5), label="signal", columns=2)
    panels = [ax for ax in figure.axes if ax.images]
    assert [len(ax.collections) for ax in panels[:2]] == [0, 1]
    points = np.concatenate(panels[1].collections[0].get_segments())
    np.testing.assert_allclose(np.linalg.norm(points - [8, 8], axis=1), 4, atol=0.1)
    assert "signal" in {ax.get_xlabel() for ax in figure.axes}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["ball"]


def test_doors():
    with pytest.raises(ValueError, match="of 0 volumes"):
        slice_panels({}, "coronal", 0.0)
    with pytest.raises(ValueError, match="plane is 'frontal'"):
        slice_panels({"a": ramp(1)}, "frontal", 0.0)


ROWS = [
    [SystemStep("data", ("scan",)), SystemStep("data", ("template",))],
    [SystemStep("learned", ("network", "of one kind"), 12345)],
    [SystemStep("fixed", ("flow",))],
]


def test_everything_is_said_and_connected():
    (ax,) = system_figure(ROWS).axes
    said = [text.get_text() for text in ax.texts if text.get_text()]
    assert said == [
        "scan",
        "template",
        "network\nof one kind\nlearns 12 345 weights",
        "flow",
        "data",
        "learned",
        "fixed",
    ]
    arrows = [text for text in ax.texts if not text.get_text()]
    assert len(arrows) == 2 + 1
    assert all(arrow.xyann[1] > arrow.xy[1] for arrow in arrows)


@pytest.mark.parametrize("name", [None, "classical", "deepcsr", "vox2cortex", "corticalflow", "cortexode", "ddot"])
def test_text_stays_in_its_box(name):
    plt.rcParams["font.size"] = 14
    figure = system_figure(system_steps(name, read_settings(get_system(name), "small")) if name else ROWS)
    figure.canvas.draw()
    (ax,) = figure.axes
    boxes = [patch.get_window_extent() for patch in ax.patches]
    for text, box in zip([text for text in ax.texts if text.get_text()], boxes):
        inside = text.get_window_extent()
        assert box.x0 < inside.x0
        assert inside.x1 < box.x1
        assert box.y0 - 2 < inside.y0
        assert inside.y1 < box.y1 + 2


def test_what_cannot_be_drawn_is_refused(unchecked):
    with pytest.raises(ValueError, match="kind is 'magic'; one of data, learned, fixed"):
        SystemStep("magic", ("x",))
    with pytest.raises(ValueError, match="a step of kind fixed has 3 weights"):
        SystemStep("fixed", ("x",), 3)
    with pytest.raises(ValueError, match="a step of kind learned has 0 weights"):
        SystemStep("learned", ("x",))
    with pytest.raises(ValueError, match=r"with \[3\] boxes in some; rows of one or two"):
        system_figure([[ROWS[0][0]] * 3])
    with pytest.raises(ValueError, match="0 rows came"):
        system_figure([])
