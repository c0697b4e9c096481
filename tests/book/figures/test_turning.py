"""The turning line: its picture, its page, and in a browser its arithmetic against ours."""

import json
import math
import re

import numpy as np
import pytest
import torch

from browser import page_file, watched_page
from meshot.loss.sliced import slice_costs, sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from meshot.view.page import joined
from meshot_book.figures.lines.line import line_costs, turning_figure, turning_player

ARITHMETIC = joined("meshot_book/figures/assets/line_costs.js", "meshot_book/figures/assets/random.js")
GENERATOR = np.random.default_rng(3)
SOURCE, TARGET = (torch.from_numpy(GENERATOR.normal(size=(9, 2)) + shift) for shift in ([0.5, 0], [-1, 0.3]))


def directions(degrees):
    radians = torch.deg2rad(torch.as_tensor(degrees, dtype=torch.float64))
    return torch.stack([radians.cos(), radians.sin()], dim=1)


def costs(degrees, source=SOURCE, target=TARGET):
    return slice_costs(DiscreteMeasure(source), DiscreteMeasure(target), directions(degrees)).numpy()


NUMBERS = {"angle", "cost", "mean", "drawn", "estimate", "error"}
WATCH_ANGLES = """() => {
  window.angles = [];
  const root = document.querySelector(".turning");
  const note = () => window.angles.push(Number(root.dataset.angle));
  new MutationObserver(note).observe(root, { attributes: true, attributeFilter: ["data-angle"] });
}"""
MEAN = costs(np.arange(180)).mean()


@pytest.fixture(scope="module")
def player():
    return turning_player(SOURCE, TARGET, 'a line & "two clouds"')


@pytest.fixture
def file(tmp_path, player):
    return page_file(tmp_path, player)


def shown(page):
    data = page.locator(".turning").evaluate("node => Object.assign({}, node.dataset)")
    return {name: float(value) for name, value in data.items() if name in NUMBERS}


def test_costs_that_are_drawn_are_ours():
    degrees = np.array([0, 17, 90, 179.5])
    assert line_costs(SOURCE.numpy(), TARGET.numpy(), degrees) == pytest.approx(costs(degrees), rel=1e-12)


def test_picture_shows_points_curve_and_mean():
    figure = turning_figure(SOURCE, TARGET, 40)
    plane, curve = figure.axes
    np.testing.assert_allclose(plane.collections[0].get_offsets(), SOURCE.numpy())
    np.testing.assert_allclose(plane.collections[2].get_offsets(), TARGET.numpy())
    assert curve.lines[0].get_ydata() == pytest.approx(costs(np.arange(180)), rel=1e-12)
    assert curve.lines[1].get_ydata()[0] == pytest.approx(MEAN, rel=1e-12)
    assert curve.lines[2].get_ydata()[0] == pytest.approx(costs([40])[0], rel=1e-12)


def test_page_is_whole_and_reaches_nowhere(player):
    page = player._repr_html_()
    assert repr(player) == "TurningPlayer(9 points on either side; run the cell to turn the line)"
    assert not re.search(r"\{[{%]|src=\"(?!data:)", page)
    assert re.findall(r"https?://[^\"]*", page) == ["http://www.w3.org/2000/svg"]
    assert 'aria-label="a line &amp; &#34;two clouds&#34;"' in page
    data = json.loads(re.search(r"const data = (\{.*?\});\n", page)[1])
    np.testing.assert_allclose(data["source"], SOURCE.numpy())


def test_arithmetic_agrees_with_the_loss(context):
    page, generator, cases = context.new_page(), np.random.default_rng(0), []
    for n in (1, 2, 5, 20):
        pair = [generator.normal(size=(n, 2)).round(n % 3) for _ in range(2)]
        cases += [[*(x.tolist() for x in pair), float(generator.uniform(0, 360))] for _ in range(10)]
    script = f"cases => {{ {ARITHMETIC} return cases.map(([x, y, angle]) => costAt(x, y, angle)); }}"
    found = page.evaluate(script, cases)
    wanted = [costs([angle], torch.tensor(x), torch.tensor(y))[0] for x, y, angle in cases]
    assert found == pytest.approx(wanted, rel=1e-5, abs=1e-10)
    values = generator.normal(size=12)
    error = page.evaluate(f"values => {{ {ARITHMETIC} return standardError(values); }}", values.tolist())
    assert error == pytest.approx(values.std(ddof=1) / math.sqrt(12), rel=1e-12)
    draws = page.evaluate(f"() => {{ {ARITHMETIC} const r = generator(1); return Array.from({{length: 2000}}, r); }}")
    assert np.mean(draws) == pytest.approx(0.5, abs=0.03)
    page.close()


def test_turning_by_keyboard_hand_and_button(file, context):
    with watched_page(context, file) as (page, troubles):
        assert page.locator(".turning img").is_hidden()
        assert shown(page)["cost"] == pytest.approx(costs([30])[0], rel=1e-9)
        assert shown(page)["mean"] == pytest.approx(MEAN, rel=1e-9)
        slider = page.locator(".turning input")
        slider.focus()
        for _ in range(4):
            page.keyboard.press("ArrowRight")
        assert shown(page)["angle"] == 34
        assert shown(page)["cost"] == pytest.approx(costs([34])[0], rel=1e-9)
        box = page.locator(".turning svg").bounding_box()
        scale = box["width"] / 700
        middle = (box["x"] + 175 * scale, box["y"] + 175 * scale)
        page.mouse.move(middle[0] + 60 * scale, middle[1])
        page.mouse.down()
        page.mouse.move(middle[0], middle[1] - 70 * scale, steps=3)
        page.mouse.up()
        assert shown(page)["angle"] == pytest.approx(90, abs=0.5)
        page.mouse.move(middle[0] + 60 * scale, middle[1] + 60 * scale)
        assert shown(page)["angle"] == pytest.approx(90, abs=0.5)
        page.locator(".turn").click()
        page.wait_for_function("() => Number(document.querySelector('.turning').dataset.angle) > 95")
        page.locator(".turn").click()
        resting = shown(page)["angle"]
        page.wait_for_timeout(100)
        assert shown(page)["angle"] == resting
        assert troubles == []


def test_a_finger_turns_and_the_page_does_not_scroll_away(tmp_path, player, context):
    path = page_file(tmp_path, player)
    path.write_text(
        path.read_text(encoding="utf-8").replace("</body>", "<div style='height:3000px'></div></body>"),
        encoding="utf-8",
    )
    with watched_page(context, path) as (page, troubles):
        page.set_viewport_size({"width": 400, "height": 800})
        touch = page.context.new_cdp_session(page)
        touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
        box = page.locator(".turning svg").bounding_box()
        scale = box["width"] / 700
        x, y = box["x"] + 175 * scale, box["y"] + 175 * scale
        for kind, place in (("Start", (x + 40, y)), ("Move", (x + 20, y - 20)), ("Move", (x, y - 40))):
            point = {"x": place[0], "y": place[1]}
            touch.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": [point]})
            page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        assert shown(page)["angle"] == pytest.approx(90, abs=1)
        assert page.evaluate("() => window.scrollY") == 0
        assert troubles == []


def test_reduced_motion_turns_the_line_in_steps(file, context):
    with watched_page(context, file) as (page, troubles):
        page.emulate_media(reduced_motion="reduce")
        page.reload()
        page.evaluate(WATCH_ANGLES)
        page.locator(".turn").click()
        page.wait_for_function("() => window.angles.at(-1) >= 60", timeout=10_000)
        page.locator(".turn").click()
        assert page.evaluate("() => [...new Set(window.angles)]") == [30, 45, 60]
        assert page.locator(".turn").text_content() == "turn"
        assert troubles == []


def test_random_lines_are_averaged(file, context):
    with watched_page(context, file) as (page, troubles):
        page.locator(".one").click()
        first = shown(page)
        assert first["estimate"] == pytest.approx(costs([first["angle"]])[0], rel=1e-9)
        assert "error" not in first
        for _ in range(40):
            page.locator(".ten").click()
        many = shown(page)
        assert many["drawn"] == 401
        assert abs(many["estimate"] - MEAN) < 4 * many["error"]
        spread = costs(np.arange(180)).std()
        assert many["error"] == pytest.approx(spread / math.sqrt(401), rel=0.15)
        assert "401 random lines" in page.locator(".turning p").inner_text()
        page.locator(".clear").click()
        assert shown(page)["drawn"] == 0
        assert page.locator(".turning svg circle[r='3.5']").count() == 0
        assert troubles == []


def test_the_mean_over_angles_is_the_sliced_loss():
    value = float(sliced_wasserstein(DiscreteMeasure(SOURCE), DiscreteMeasure(TARGET), directions(np.arange(180))))
    assert pytest.approx(value, rel=1e-12) == MEAN


def test_doors(unchecked):
    with pytest.raises(ValueError, match="description is empty"):
        turning_player(SOURCE, TARGET, " ")
    with pytest.raises(ValueError, match="angle is 180"):
        turning_player(SOURCE, TARGET, "x", 180)
    with pytest.raises(ValueError, match="'source': 9, 'target': 8"):
        turning_player(SOURCE, TARGET[:8], "x")
    with pytest.raises(ValueError, match="at most 60"):
        turning_player(torch.zeros(61, 2), torch.zeros(61, 2), "x")
    with pytest.raises(ValueError, match=r"source has shape \(9, 3\)"):
        turning_player(torch.zeros(9, 3), TARGET, "x")
