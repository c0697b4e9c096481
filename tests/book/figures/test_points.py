"""Pictures of points: what is drawn is what was given."""

import base64
import json
import re

import matplotlib
import numpy as np
import pytest
import torch

matplotlib.use("agg")

import matplotlib.pyplot as plt
from matplotlib.colors import to_rgb

from browser import page_file, watched_page
from meshot.mesh.geometry import even_points
from meshot.mesh.shapes import star
from meshot.view.style import LOSS_COLOURS, LOSS_DASHES, loss_line, use_style
from meshot_book.figures.points.player import point_player
from meshot_book.figures.points.points import box_around, curves_figure, draw_contour, force_figure, process_figure

WATCH_STEPS = """() => {
  window.steps = [];
  const note = (changes) => changes.forEach((c) => window.steps.push(Number(c.target.textContent.split(" ")[1])));
  new MutationObserver(note).observe(document.querySelector("output"), { childList: true });
}"""
SHAPE = star(5, 1.5, 0.35)
POINTS = even_points(SHAPE, 20)


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def test_losses_differ_in_colour_and_dashes():
    assert len(set(LOSS_COLOURS.values())) == len(set(LOSS_DASHES.values())) == len(LOSS_COLOURS)
    assert loss_line("Chamfer") == {"color": LOSS_COLOURS["Chamfer"], "linestyle": LOSS_DASHES["Chamfer"]}
    # Told apart in grey as well: relative luminance differs between the two rivals.
    grey = [np.dot([0.2126, 0.7152, 0.0722], to_rgb(LOSS_COLOURS[name])) for name in ("Chamfer", "sliced Wasserstein")]
    assert abs(grey[0] - grey[1]) > 0.05


def test_style_sets_readable_type():
    with plt.rc_context():
        use_style()
        assert plt.rcParams["font.size"] >= 12
        use_style(14)
        assert plt.rcParams["font.size"] == plt.rcParams["axes.titlesize"] == 14
        assert plt.rcParams["legend.fontsize"] == 13


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


def test_curves_figure_marks_floors():
    curves = {"one (mm)": {"Chamfer": ([0, 1, 10], [3, 2, 1])}, "two (mm)": {"Chamfer": ([0, 1, 10], [3, 2, 1])}}
    figure = curves_figure(curves, "step", {"two (mm)": {"floor": 0.5}})
    assert [ax.get_ylabel() for ax in figure.axes] == list(curves)
    assert len(figure.axes[0].lines) == 1
    assert figure.axes[1].lines[1].get_ydata()[0] == 0.5


def test_player_holds_the_points_and_reaches_nowhere():
    frames = {"Chamfer": torch.stack([POINTS * 0.5, POINTS]), "<b>": torch.stack([POINTS, POINTS])}
    player = point_player(frames, [0, 10], SHAPE, 'what is "seen"')
    page = player._repr_html_()
    assert repr(player) == "Player(2 frames; run the cell to see it move)"
    assert page == point_player(frames, [0, 10], SHAPE, 'what is "seen"')._repr_html_()
    assert not re.search(r"\{[{%]|https?:|src=\"(?!data:)", page)
    assert 'aria-label="what is &#34;seen&#34;"' in page
    data = json.loads(re.search(r"const data = (\{.*?\});\n", page)[1])
    assert "<b>" not in page
    assert data["panels"][1]["name"] == "<b>"
    left, right, bottom, top = box_around(SHAPE)
    shares = np.frombuffer(base64.b64decode(data["panels"][0]["points"]), "<u2").reshape(2, 20, 2) / 65535
    found = shares * [right - left, top - bottom] + [left, bottom]
    np.testing.assert_allclose(found, frames["Chamfer"].numpy(), atol=1e-4)


def test_player_needs_a_frame_for_each_step():
    with pytest.raises(ValueError, match="2 frames for 3 steps"):
        point_player({"Chamfer": torch.stack([POINTS, POINTS])}, [0, 1, 2], SHAPE, "x")


def test_the_player_glides_pauses_and_goes_on(tmp_path, context):
    """Points are drawn between the frames; a press pauses where they are, and the next goes on from there."""
    frames = {"Chamfer": torch.stack([POINTS * (k / 100) for k in range(101)])}
    player = point_player(frames, range(0, 10_001, 100), SHAPE, "points")
    with watched_page(context, page_file(tmp_path, player)) as (page, troubles):
        button, clock = page.locator(".controls button"), page.locator("output")
        assert page.locator("img").is_hidden()
        assert clock.text_content() == "step 10000"
        page.evaluate(WATCH_STEPS)
        button.click()
        page.wait_for_function("() => window.steps.some((step) => step > 100)")
        assert button.text_content() == "❚❚ pause"
        button.click()
        stopped = page.evaluate("() => window.steps.at(-1)")
        page.wait_for_timeout(300)
        assert page.evaluate("() => window.steps.at(-1)") == stopped
        assert button.text_content() == "▶ play"
        button.click()
        page.wait_for_function("(stopped) => window.steps.at(-1) > stopped + 50", arg=stopped)
        steps = page.evaluate("() => window.steps")
        assert steps[0] == 0
        assert steps == sorted(steps)
        assert any(step % 100 for step in steps)
        page.locator("input").focus()
        page.keyboard.press("End")
        assert button.text_content() == "▶ play"
        assert clock.text_content() == "step 10000"
        assert page.locator("input").get_attribute("aria-valuetext") == "step 10000"
        assert troubles == []
