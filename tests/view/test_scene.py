"""The interactive view in a browser without a network: still, click, turn, zoom, switch; and what it holds."""

import base64
import io
import json
import re
import subprocess
import sys
import zlib

import matplotlib.image
import numpy as np
import pytest
import torch

from browser import page_file, watched_page
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import folded_sphere, icosphere
from meshot.view.scene import interactive
from refusals import refuses

ALT = "a sphere, coloured by height"


def page_data(page: str) -> dict:
    return json.loads(re.search(r"const data = (.*);\n", page).group(1))


def unpacked(data: dict) -> list[np.ndarray]:
    """The twin of the script's reader."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(data["packed"])), dtype=np.uint8).astype(np.int64)
    arrays, start = [], 0
    for n in data["lengths"]:
        low, middle, high = planes[start : start + 3 * n].reshape(3, n)
        zigzag = low | middle << 8 | high << 16
        arrays.append((zigzag >> 1) ^ -(zigzag & 1))
        start += 3 * n
    return arrays


@pytest.fixture(scope="module")
def height_scene():
    """Three items: a sphere coloured by height, the same sphere plain, and a smaller one of other faces."""
    mesh = icosphere(4, 10.0)
    meshes = {"high & low": mesh, "plain": mesh, "small": icosphere(3, 5.0)}
    return interactive(meshes, {"high & low": mesh.vertices[:, 2]}, alt=ALT, title="<Spheres>", label="height")


@pytest.fixture
def file(tmp_path, height_scene):
    return page_file(tmp_path, height_scene)


def pixels(page) -> np.ndarray:
    """What the canvas shows, on the white page, as colours of shape (height, width, 3)."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    shot = page.locator(".surface-scene .stage").screenshot()
    image = matplotlib.image.imread(io.BytesIO(shot), format="png")[..., :3]
    # The ring around what has the focus is not the picture.
    image[:4], image[-4:], image[:, :4], image[:, -4:] = image[4, 4], image[4, 4], image[4, 4], image[4, 4]
    return image


def share_drawn(image: np.ndarray) -> float:
    return float((image.min(axis=2) < 0.97).mean())


def started(page):
    page.locator(".surface-scene .start").click()
    page.wait_for_selector(".surface-scene canvas")


def test_the_still_comes_first_and_a_click_brings_the_same_picture(file, context):
    with watched_page(context, file) as (page, troubles):
        assert page.locator("canvas").count() == 0
        assert page.locator(".surface-scene img").get_attribute("alt") == ALT
        assert page.locator(".hint").text_content() == "click, or press Enter, to turn it"
        page.evaluate("() => document.querySelector('.hint').hidden = true")
        still = pixels(page)
        started(page)
        live = pixels(page)
        disc = np.pi * 10**2 / (2 * 11.0) ** 2 * 3 / 4
        assert share_drawn(still) == pytest.approx(disc, rel=0.02)
        assert share_drawn(live) == pytest.approx(disc, rel=0.02)
        assert np.abs(still - live).mean() < 0.02
        assert troubles == []


def test_dragging_turns_the_surface_after_the_hand(file, context):
    """Values rise upwards: turning the top down towards the eye brings its colour (yellow) to the middle."""
    with watched_page(context, file) as (page, troubles):
        started(page)
        box = page.locator("canvas").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y + 150 * np.pi / 2, steps=6)
        page.mouse.up()
        image = pixels(page)
        red, green, blue = image[image.shape[0] // 2, image.shape[1] // 2]
        assert red > 0.9
        assert green > 0.8
        assert blue < 0.3
        assert troubles == []


def test_wheel_and_keys_zoom_turn_reset_and_leave(file, context):
    with watched_page(context, file) as (page, troubles):
        page.locator(".surface-scene .start").focus()
        page.keyboard.press("Enter")
        page.wait_for_selector(".surface-scene canvas")
        first = pixels(page)
        page.locator("canvas").hover()
        # Unlike other input the wheel is not waited for.
        page.evaluate("() => document.querySelector('canvas').addEventListener('wheel', () => { window.seen = true; })")
        page.mouse.wheel(0, 400)
        page.wait_for_function("() => window.seen")
        assert share_drawn(pixels(page)) == pytest.approx(share_drawn(first) * np.exp(-1.2), rel=0.03)
        page.keyboard.press("0")
        assert np.abs(pixels(page) - first).max() < 0.02
        page.keyboard.press("ArrowDown")
        turned = pixels(page)
        assert np.abs(turned - first).mean() > 0.005
        page.keyboard.press("ArrowUp")
        assert np.abs(pixels(page) - first).max() < 0.05
        page.keyboard.press("Escape")
        assert page.locator("canvas").count() == 0
        assert page.locator(".surface-scene .start").is_visible()
        started(page)
        page.locator(".back").click()
        assert page.locator("canvas").count() == 0
        assert troubles == []


def test_names_switch_between_surfaces_even_before_the_first_click(file, context):
    with watched_page(context, file) as (page, troubles):
        page.get_by_role("radio", name="high & low").focus()
        page.keyboard.press("ArrowRight")
        page.wait_for_selector(".surface-scene canvas")
        assert page.evaluate("() => document.activeElement.type") == "radio"
        plain = pixels(page)
        middle = plain[plain.shape[0] // 2, plain.shape[1] // 2]
        assert np.ptp(middle) < 0.06
        page.get_by_role("radio", name="small").check()
        assert share_drawn(pixels(page)) == pytest.approx(share_drawn(plain) / 4, rel=0.03)
        page.get_by_role("radio", name="high & low").check()
        coloured = pixels(page)
        assert float(np.ptp(coloured[coloured.shape[0] // 2, coloured.shape[1] // 2])) > 0.2
        assert troubles == []


@pytest.mark.parametrize(
    ("absence", "sentence"),
    [
        ("HTMLCanvasElement.prototype.getContext = () => null", "WebGL 2 is missing in this browser"),
        ("delete window.DecompressionStream", "this browser is too old"),
    ],
)
def test_a_browser_that_cannot_says_so_and_keeps_the_still(file, context, absence, sentence):
    with watched_page(context, file) as (page, troubles):
        page.evaluate(f"() => {{ {absence}; }}")
        page.locator(".surface-scene .start").click()
        page.wait_for_function("() => document.querySelector('.hint').textContent.startsWith('Only')")
        assert sentence in page.locator(".hint").text_content()
        assert page.locator(".surface-scene img").is_visible()
        assert troubles == []


def test_a_notebook_that_may_not_run_scripts_shows_the_still_and_says_what_to_do(height_scene):
    words = re.sub(r"<script>.*</script>", "", height_scene.html, flags=re.DOTALL)
    assert "run the cell to turn it" in words
    assert "click" not in words
    assert words.count("<img") == 1


def test_a_narrow_screen_is_not_widened_and_dark_pages_keep_their_ground(file, context):
    file.write_text(
        file.read_text(encoding="utf-8").replace("<body>", "<body style='background:#14181e;color:#ced6dd'>"),
        encoding="utf-8",
    )
    with watched_page(context, file) as (page, troubles):
        page.set_viewport_size({"width": 400, "height": 800})
        started(page)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
        np.testing.assert_allclose(pixels(page)[3, 3] * 255, [0x14, 0x18, 0x1E], atol=1)
        assert troubles == []


def test_the_data_hold_the_surface_to_a_sixteen_thousandth_and_equal_arrays_once():
    mesh = folded_sphere(3)
    values = mesh.vertices[:, 0].clone()
    values[5] = torch.nan
    data = page_data(interactive({"a": mesh, "b": mesh}, {"a": values}, alt=ALT, limits=(-30, 30)).html)
    arrays = unpacked(data)
    first, second = data["items"]
    assert len(arrays) == 3
    assert (first["vertices"], first["faces"]) == (second["vertices"], second["faces"])
    assert second["values"] == -1
    places = arrays[first["vertices"]].reshape(3, -1).T.cumsum(axis=0) * data["step"] + data["low"]
    vertices = mesh.vertices.numpy()
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    np.testing.assert_allclose(places + centre, vertices, atol=np.ptp(vertices, axis=0).max() / 32000)
    steps = arrays[first["faces"]].reshape(3, -1)
    corners = np.cumsum(steps[0]) + np.stack([0 * steps[0], steps[1], steps[2]])
    assert np.array_equal(corners.T, mesh.faces.numpy())
    shades = arrays[first["values"]]
    assert shades[5] == 0
    known = np.arange(len(vertices)) != 5
    np.testing.assert_allclose((shades[known] - 1) / 254 * 60 - 30, vertices[known, 0].clip(-30, 30), atol=0.12)


def test_a_surface_of_twenty_thousand_faces_takes_less_than_300_kb():
    mesh = folded_sphere(5)
    assert len(mesh.faces) == 20480
    assert len(interactive(mesh, mesh.vertices[:, 2], alt=ALT).html) < 300_000


def test_two_runs_give_the_same_page(height_scene):
    code = (
        "from meshot.view.scene import interactive; from meshot.mesh.shapes import icosphere; m = icosphere(2); "
        f"print(interactive(m, m.vertices[:, 2], alt={ALT!r}).html, end='')"
    )
    again = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=True).stdout
    mesh = icosphere(2)
    assert again == interactive(mesh, mesh.vertices[:, 2], alt=ALT).html


def test_words_are_escaped_and_the_bar_names_its_unit_and_what_lies_beyond():
    mesh = Mesh(torch.tensor([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]]), torch.tensor([[0, 1, 2]]))
    scene = interactive(
        {"</script>": mesh}, {"</script>": [0, 1, 9]}, alt='say "a" & <b>', title="<i>", label="x<y", limits=(0, 2)
    )
    assert scene.html.count("</script>") == 1
    assert "say &#34;a&#34; &amp; &lt;b&gt;" in scene.html
    assert "<i>" not in scene.html
    assert "x&lt;y (mm); above 2: the colour of the end" in scene.html
    assert not re.search(r"\{[{%]", scene.html)
    assert repr(scene) == "Scene(</script>; run the cell to turn it)"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"alt": " "}, "alt is empty"),
        ({"alt": ALT, "values": [1.0]}, "one for each vertex"),
        ({"alt": ALT, "view": "above"}, "view is 'above'"),
    ],
)
def test_bad_requests_are_refused(arguments, message):
    refuses(message, interactive, icosphere(0), **arguments)
