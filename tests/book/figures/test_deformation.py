"""The surface that a reader moves through time: still, slider, button, keys, without a network."""

import io
import re
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import torch

from browser import page_file, watched_page
from meshot.mesh.shapes import icosphere
from meshot_book.figures.flows.deformation import deformation_view

ALT = "a sphere that grows"
#: Every word that the button and the clock show, one after the other, however slow the machine is.
WATCH_WORDS = """() => {
  window.words = [];
  const watch = new MutationObserver((changes) => window.words.push(...changes.map((c) => c.target.textContent)));
  document.querySelectorAll(".controls button, output").forEach((node) => watch.observe(node, { childList: true }));
}"""
TIMES = [0.0, 0.25, 0.5, 1.0]


def grown(sizes, mesh):
    return torch.stack([size * mesh.vertices for size in sizes])


@pytest.fixture(scope="module")
def view():
    """A sphere that doubles, one that does not, with values; and a smaller one that rests."""
    mesh = icosphere(2, 5.0)
    paths = {"grows": grown([1, 1.25, 1.5, 2], mesh), "stays <still>": grown([1, 1, 1, 1], mesh)}
    height = np.stack([path[:, :, 2].numpy() for path in paths.values()])
    values = dict(zip(paths, height, strict=True))
    return deformation_view(
        mesh, paths, TIMES, alt=ALT, values=values, beside={"target": icosphere(2, 2.5)}, label="height"
    )


@pytest.fixture
def file(tmp_path, view) -> Path:
    return page_file(tmp_path, view)


def share_drawn(page) -> float:
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.evaluate("() => document.activeElement.blur()")
    shot = page.locator(".surface-scene .stage").screenshot()
    image = matplotlib.image.imread(io.BytesIO(shot), format="png")[..., :3]
    return float((image.min(axis=2) < 0.97).mean())


def move_to(page, k):
    page.eval_on_selector(".controls input", "(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", str(k))


def test_the_still_is_the_end_and_the_slider_brings_every_moment(file, context):
    with watched_page(context, file) as (page, troubles):
        assert page.locator("canvas").count() == 0
        assert page.locator("output").text_content() == "t = 1.00"
        page.evaluate("() => document.querySelector('.hint').hidden = true")
        end = share_drawn(page)
        move_to(page, 3)
        page.wait_for_selector("canvas")
        assert share_drawn(page) == pytest.approx(end, rel=0.03)
        for k, size in enumerate([1, 1.25, 1.5, 2]):
            move_to(page, k)
            assert share_drawn(page) == pytest.approx(end * (size / 2) ** 2, rel=0.04)
            assert page.locator("output").text_content() == f"t = {TIMES[k]:.2f}"
        assert troubles == []


def test_choices_switch_and_what_rests_has_no_time(file, context):
    with watched_page(context, file) as (page, troubles):
        move_to(page, 3)
        page.wait_for_selector("canvas")
        end = share_drawn(page)
        page.get_by_role("radio", name="stays").check()
        assert share_drawn(page) == pytest.approx(end / 4, rel=0.04)
        page.get_by_role("radio", name="target").check()
        assert share_drawn(page) == pytest.approx(end / 16, rel=0.06)
        assert page.locator(".controls input").is_disabled()
        assert page.locator("output").text_content() == "it rests"
        page.get_by_role("radio", name="grows").check()
        assert page.locator(".controls input").is_enabled()
        assert page.locator(".choices input").count() == 3
        assert not page.locator(".surface-scene .names").is_visible()
        assert troubles == []


def test_the_button_plays_to_the_end_from_the_keyboard(file, context):
    with watched_page(context, file) as (page, troubles):
        page.evaluate(WATCH_WORDS)
        page.locator(".controls button").focus()
        page.keyboard.press("Enter")
        page.wait_for_function("() => window.words.at(-1) === '▶ play'", timeout=5000)
        words = page.evaluate("() => window.words")
        assert [word for word in words if word.startswith("t")] == [f"t = {t:.2f}" for t in TIMES]
        assert [word for word in words if not word.startswith("t")] == ["❚❚ pause", "▶ play"]
        assert troubles == []


def test_the_slider_keeps_the_focus_when_it_opens_the_view(file, context):
    with watched_page(context, file) as (page, troubles):
        page.locator(".controls input").focus()
        page.keyboard.press("ArrowLeft")
        page.wait_for_selector("canvas")
        page.keyboard.press("ArrowLeft")
        assert page.locator("output").text_content() == "t = 0.25"
        page.locator(".back").click()
        page.locator(".surface-scene .start").click()
        page.wait_for_selector("canvas")
        assert page.evaluate("() => document.activeElement.tagName") == "CANVAS"
        assert troubles == []


def test_a_press_while_it_plays_stops_it(file, context):
    with watched_page(context, file) as (page, troubles):
        page.emulate_media(reduced_motion="reduce")
        page.reload()
        page.locator(".controls button").click()
        page.locator(".controls button").click()
        before = page.locator("output").text_content()
        page.wait_for_timeout(700)
        assert page.locator("output").text_content() == before != "t = 1.00"
        assert troubles == []


def test_a_narrow_screen_is_not_widened(file, context):
    with watched_page(context, file) as (page, troubles):
        page.set_viewport_size({"width": 400, "height": 800})
        move_to(page, 1)
        page.wait_for_selector("canvas")
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
        assert troubles == []


def test_without_scripts_there_is_the_still_and_nothing_else(view):
    words = re.sub(r"<script>.*?</script>", "", view.html, flags=re.DOTALL)
    assert words.count("<img") == 1
    assert '<div class="controls" hidden>' in words
    assert '<fieldset class="choices" hidden>' in words
    assert not re.search(r"\{[{%]", view.html)
    assert "stays <still>" not in view.html
    assert repr(view) == "Deformation(grows, stays <still>, target; 4 frames; run the cell to see it move)"


def test_the_end_is_stored_once(view):
    mesh = icosphere(2, 5.0)
    once = deformation_view(mesh, {"a": grown([1, 2], mesh)}, [0.0, 1.0], alt=ALT)
    twice = deformation_view(mesh, {"a": grown([1, 2], mesh), "b": grown([1, 2], mesh)}, [0.0, 1.0], alt=ALT)
    assert len(twice.html) - len(once.html) < 500


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"paths": {}}, "paths is empty"),
        ({"times": [0.0, 0.0, 0.5, 1.0]}, "rising numbers are needed"),
        ({"times": [0.0, 1.0]}, "has shape"),
        ({"values": {"b": np.zeros((4, 42))}}, "none of the paths"),
        ({"values": {"a": np.zeros((4, 7))}}, "a row a time"),
        ({"beside": {"a": icosphere(0)}}, "rename one"),
        ({"alt": " "}, "alt is empty"),
    ],
)
def test_bad_requests_are_refused(change, message, unchecked):
    mesh = icosphere(1)
    given = {"mesh": mesh, "paths": {"a": grown([1, 1, 1, 2], mesh)}, "times": TIMES, "alt": ALT} | change
    with pytest.raises(ValueError, match=message):
        deformation_view(**given)
