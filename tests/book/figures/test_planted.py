"""Planted errors: their sections, their table, and the page on which one is chosen."""

import json
import math
import re

import numpy as np
import pytest
import torch

from browser import page_file, watched_page
from meshot.mesh.shapes import icosphere
from meshot_book.defects import shifted
from meshot_book.figures.measures.planted import (
    PlantedState,
    Window,
    planted_player,
    ratio_figure,
    round_length,
    sections_figure,
)

SPHERE = icosphere(3, 10.0)
WINDOW = Window(torch.tensor([0.0, 0.0, 10.0], dtype=torch.float64), 1, 6.0)
METRICS = ["EMD <mm>", "crossing"]


def state(size, shift, ratio, crossing=0.0):
    values = [f"{shift:g}", str(int(crossing > 0))]
    return PlantedState(size, shifted(SPHERE, (shift, 0.0, 0.0)), values, [ratio, crossing])


def errors():
    states = [state("0.1 mm", 0.1, 1.0), state("1 mm", 1.0, 5.0), state("3 mm", 3.0, 40.0, math.inf)]
    return {"shift": (WINDOW, states), "one & only": (WINDOW, [state("2 mm", 2.0, 1.9)])}


@pytest.fixture(scope="module")
def player():
    return planted_player(SPHERE, errors(), METRICS, 'an error & "its bars"', "a note")


@pytest.fixture
def file(tmp_path, player):
    return page_file(tmp_path, player)


def test_a_section_of_a_sphere_is_a_circle():
    lines = WINDOW.lines(SPHERE)
    radii = np.hypot(lines[:, :, 0], lines[:, :, 1] + 10)
    np.testing.assert_allclose(radii, 10, atol=0.1)
    assert np.abs(lines).max(axis=(1, 2)).min() <= 6
    assert 5 < len(lines) < 60


def test_sections_show_target_and_error():
    figure = sections_figure({"shift": (WINDOW, shifted(SPHERE, (0.0, 0.0, 1.0)))}, SPHERE, columns=2)
    shown, hidden = figure.axes
    target, damaged = shown.collections
    tops = [np.concatenate(part.get_segments())[:, 1].max() for part in (target, damaged)]
    assert tops[1] - tops[0] == pytest.approx(1, abs=1e-6)
    assert not hidden.get_visible()


@pytest.mark.parametrize(("half", "length"), [(22, 10), (16, 5), (8, 2), (4, 2), (0.3, 0.1)])
def test_bars_of_scale_are_round(half, length):
    assert round_length(half) == pytest.approx(length)


def test_the_table_colours_what_stands_out():
    figure = ratio_figure(
        [["a", "b"], ["c", "d"]], np.array([[0.5, 3.0], [np.inf, 2.0]]), ["x", "y"], ["p", "q"], "times"
    )
    data = figure.axes[0].images[0].get_array()
    assert np.ma.getmaskarray(np.ma.masked_invalid(data)).tolist() == [[True, False], [False, True]]
    assert float(data[1, 0]) == 50
    assert [text.get_text() for text in figure.axes[0].texts] == ["a", "b", "c", "d"]


def test_the_table_refuses_what_does_not_fit():
    with pytest.raises(ValueError, match=r"\(1, 2\) is needed"):
        ratio_figure([["a", "b"]], np.ones((2, 2)), ["x"], ["p", "q"], "times")


def shown(page):
    return page.locator(".planted").evaluate("node => Object.assign({}, node.dataset)")


def widths(page):
    return page.eval_on_selector_all(".planted .track i", "nodes => nodes.map(n => parseFloat(n.style.width))")


def colours(page):
    return page.eval_on_selector_all(
        ".planted .track i", "nodes => nodes.map(n => getComputedStyle(n).backgroundColor)"
    )


def test_choosing_and_sliding(file, context):
    with watched_page(context, file) as (page, troubles):
        assert page.locator(".planted img").is_hidden()
        found = shown(page)
        assert (found["error"], found["size"], found["seen"]) == ("shift", "3 mm", "EMD <mm>|crossing")
        slider = page.locator(".planted input")
        slider.focus()
        page.keyboard.press("ArrowLeft")
        assert (shown(page)["size"], shown(page)["seen"]) == ("1 mm", "EMD <mm>")
        assert widths(page) == pytest.approx([100 * (math.log10(5) + 1) / 3, 0], rel=1e-4)
        assert page.get_by_role("status").text_content() == "shift, 1 mm. Detected by: EMD <mm>."
        page.keyboard.press("Home")
        assert shown(page)["seen"] == ""
        assert widths(page)[0] == pytest.approx(100 / 3, rel=1e-4)
        page.locator(".planted select").select_option("1")
        assert (shown(page)["error"], shown(page)["size"]) == ("one & only", "2 mm")
        assert slider.is_disabled()
        assert "Detected by none" in page.get_by_role("status").text_content()
        assert page.locator(".planted svg path").count() == 3  # target, error, scale
        assert page.locator(".planted svg text").text_content() == "2 mm"
        assert troubles == []


def test_a_bar_is_grey_until_its_value_stands_out(tmp_path, context):
    ratios = {"1 mm": 0.5, "2 mm": 2.0, "3 mm": 2.01, "4 mm": 2.0, "5 mm": math.inf}
    states = [state(size, 1.0, ratio, crossing=5.0) for size, ratio in ratios.items()]
    player = planted_player(SPHERE, {"shift": (WINDOW, states)}, METRICS, "an error", "a note")
    with watched_page(context, page_file(tmp_path, player)) as (page, troubles):
        page.locator(".planted input").focus()
        found = []
        for _ in states:
            found.append((shown(page)["size"], *colours(page)))
            page.keyboard.press("ArrowLeft")
        grey, blue = "rgb(181, 181, 181)", "rgb(0, 114, 178)"
        assert found[::-1] == [(size, blue if ratio > 2 else grey, blue) for size, ratio in ratios.items()]
        assert troubles == []


def test_it_fits_a_narrow_screen(file, context):
    with watched_page(context, file) as (page, troubles):
        page.set_viewport_size({"width": 400, "height": 800})
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
        assert troubles == []


def test_without_scripts_the_still_stays_and_the_page_reaches_nowhere(player):
    words = re.sub(r"<script>.*</script>", "", player.html, flags=re.DOTALL)
    assert words.count("<img") == 1
    assert '<div class="controls" hidden>' in words
    outside = player.html.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"\{[{%]|https?:|src=\"(?!data:)|animat", outside)
    assert "an error &amp; &#34;its bars&#34;" in player.html
    data = json.loads(re.search(r"const data = (\{.*?\});\n", player.html)[1])
    assert data["errors"][0]["states"][2]["ratios"] == [40, None]
    assert repr(player) == "PlantedPlayer(2 errors; run the cell to choose one)"
    assert planted_player(SPHERE, errors(), METRICS, 'an error & "its bars"', "a note").html == player.html


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"description": " "}, "description is empty"),
        ({"errors": {}}, "errors is empty"),
        ({"errors": {"a": (WINDOW, [])}}, "no state"),
        ({"metrics": ["EMD"]}, "for each of 1 metrics"),
    ],
)
def test_doors(change, words):
    given = {"errors": errors(), "metrics": METRICS, "description": "seen", "note": ""} | change
    with pytest.raises(ValueError, match=words):
        planted_player(SPHERE, **given)
