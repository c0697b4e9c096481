"""Pictures of points, forces and directions: what is drawn is what was given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib.colors import to_rgb
from matplotlib.quiver import Quiver

from meshot.loss.directions import random_directions
from meshot.mesh.geometry import even_points
from meshot.mesh.shapes import star
from meshot.view.style import LOSS_COLOURS, LOSS_DASHES, VERMILLION, loss_line, use_style
from meshot_book.figures.points.points import (
    ForceField,
    directions_figure,
    disc_places,
    draw_contour,
    force_figure,
    force_panels,
    process_figure,
)


def test_a_line_has_one_place_in_the_disc():
    directions = random_directions(50, 3, 0).numpy()
    places = disc_places(directions)
    assert np.linalg.norm(places, axis=1).max() <= 1
    assert disc_places(-directions) == pytest.approx(places)
    assert disc_places(np.array([[0.0, 0, -1]])) == pytest.approx(np.zeros((1, 2)))
    assert np.linalg.norm(disc_places(np.array([[0.6, 0.8, 0]]))) == pytest.approx(1)


def test_equal_areas():
    """Uniform directions fill the disc uniformly: the share within radius r is r²."""
    radius = np.linalg.norm(disc_places(random_directions(20_000, 3, 0).numpy()), axis=1)
    for r in (0.3, 0.6, 0.9):
        assert np.mean(radius < r) == pytest.approx(r * r, abs=0.015)


def test_a_disc_for_each_set():
    sets = {name: random_directions(n, 3, 0) for name, n in (("few", 5), ("many", 40), ("one", 1))}
    figure = directions_figure(sets)
    assert [ax.get_title() for ax in figure.axes] == ["few", "many", "one", ""]
    np.testing.assert_allclose(figure.axes[1].collections[0].get_offsets(), disc_places(sets["many"].numpy()))


LIMITS = (-50.0, 50.0, -50.0, 50.0)


@pytest.fixture
def field():
    points = torch.tensor([[0.0, 0], [10, 0], [20, 0]], dtype=torch.float64)
    forces = torch.tensor([[0.0, 3], [0, 0], [0, -40]], dtype=torch.float64)
    return ForceField(points, forces, points + 5)


def arrows(ax):
    (quiver,) = [item for item in ax.collections if isinstance(item, Quiver)]
    return np.stack([quiver.U, quiver.V], axis=1)


def test_arrows_have_their_length_and_points_at_rest_none(field):
    figure = force_panels({"Chamfer": field, "other\ntwo lines": field, "third": field}, LIMITS)
    assert len(figure.axes) == 4
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3], [0, -40]])
    assert figure.axes[0].get_title() == "Chamfer"
    (quiver,) = [item for item in figure.axes[0].collections if isinstance(item, Quiver)]
    assert np.allclose(quiver.get_facecolor()[0, :3], [int(VERMILLION[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def test_long_arrows_are_cut_and_marked(field):
    figure = force_panels({"Chamfer": field}, LIMITS, longest=10.0, columns=1)
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3], [0, -10]])
    marked = [item.get_offsets() for item in figure.axes[0].collections if 70 in getattr(item, "get_sizes", tuple)()]
    np.testing.assert_allclose(marked[0], [[20, 0]])


@pytest.mark.parametrize(("typical", "factor"), [(8.0, 0.2), (400.0, 10.0)])
def test_scaled_arrows_state_their_factor(field, typical, factor):
    figure = force_panels({"Chamfer": field}, LIMITS, typical=typical)
    np.testing.assert_allclose(arrows(figure.axes[0]), factor * np.array([[0, 3], [0, -40]]))
    assert figure.axes[0].get_title() == f"Chamfer\narrows × {factor:g}"


def test_an_inset_target_lies_inside_and_arrows_stay(field):
    figure = force_panels({"Chamfer": field}, LIMITS, inset=0.5)
    squares, points = figure.axes[0].collections[:2]
    np.testing.assert_allclose(squares.get_offsets(), 0.5 * field.target.numpy())
    np.testing.assert_allclose(points.get_offsets(), field.points.numpy())
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3], [0, -40]])


def test_doors(field):
    with pytest.raises(ValueError, match="fields is empty"):
        force_panels({}, LIMITS)
    with pytest.raises(ValueError, match="longest is 0"):
        force_panels({"a": field}, LIMITS, longest=0.0)
    with pytest.raises(ValueError, match="typical is 0"):
        force_panels({"a": field}, LIMITS, typical=0.0)
    with pytest.raises(ValueError, match="columns is 0"):
        force_panels({"a": field}, LIMITS, columns=0)


SHAPE = star(5, 1.5, 0.35)


POINTS = even_points(SHAPE, 20)


def test_losses_differ_in_colour_and_dashes():
    assert len(set(LOSS_COLOURS.values())) == len(set(LOSS_DASHES.values())) == len(LOSS_COLOURS)
    assert loss_line("Chamfer") == {"color": LOSS_COLOURS["Chamfer"], "linestyle": LOSS_DASHES["Chamfer"]}
    # Told apart in grey as well: relative luminance differs between the two rivals.
    grey = [np.dot([0.2126, 0.7152, 0.0722], to_rgb(LOSS_COLOURS[name])) for name in ("Chamfer", "sliced Wasserstein")]
    assert abs(grey[0] - grey[1]) > 0.05


@pytest.mark.parametrize("size", [0, -3.0, float("nan"), float("inf")])
def test_a_size_that_nobody_can_read_is_refused(size):
    with pytest.raises(ValueError, match="a size in points above 1"):
        use_style(size)


def test_contour_is_drawn_edge_by_edge():
    _, ax = plt.subplots()
    draw_contour(ax, SHAPE, label="target")
    drawn = np.array([line.get_xydata() for line in ax.lines])
    np.testing.assert_allclose(drawn, SHAPE.vertices[SHAPE.edges].numpy())
    assert [text for text in (line.get_label() for line in ax.lines) if text == "target"] == ["target"]


def test_process_figure_shows_the_points():
    moments = {name: {0: POINTS, 7: POINTS * k} for k, name in ((0.5, "Chamfer"), (0.9, "sliced Wasserstein"))}
    figure = process_figure(moments, SHAPE)
    assert [ax.get_title() for ax in figure.axes] == [
        "Chamfer\nstart", "sliced Wasserstein\nstart", "after 7 steps", "after 7 steps",
    ]  # fmt: skip
    np.testing.assert_allclose(figure.axes[3].collections[0].get_offsets(), 0.9 * POINTS.numpy())


def test_force_figure_keeps_directions():
    forces = {"Chamfer, step 0": -POINTS, "sliced Wasserstein, step 0": 0 * POINTS}
    points = dict.fromkeys(forces, POINTS)
    probes = torch.tensor([[0.0, 0.5], [1.0, 0.0]], dtype=torch.float64)
    figure = force_figure(points, forces, probes, dict.fromkeys(forces, probes), SHAPE, every=1)
    forced, resting = ([c for c in ax.collections if hasattr(c, "U")] for ax in figure.axes)
    arrows = np.stack([forced[1].U, forced[1].V], axis=1)
    assert (np.linalg.norm(arrows, axis=1) < 0.46).all()
    assert np.quantile(np.linalg.norm(arrows, axis=1), 0.9) == pytest.approx(0.3)
    np.testing.assert_allclose(
        np.cross(np.pad(arrows, ((0, 0), (0, 1))), np.pad(POINTS.numpy(), ((0, 0), (0, 1)))), 0, atol=1e-12
    )
    assert len(resting[1].U) == 0
