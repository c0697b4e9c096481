"""Sorting as transport in a browser without a network: its arithmetic against POT, its points against the hand."""

import json
import re

import numpy as np
import ot
import pytest
import torch

from browser import page_file, watched_page
from meshot.view.page import joined
from meshot_book.figures.lines.line import sorting_player

SOURCE, TARGET = [1.0, 2.2, 2.9, 5.5], [3.0, 4.4, 0.8, 7.2, 9.3]
ARITHMETIC = joined("meshot_book/figures/assets/pairing.js", "meshot_book/figures/assets/random.js")
ALT = "two rows of <points>"


def measure(values):
    return torch.tensor(values, dtype=torch.float64)


@pytest.fixture(scope="module")
def player():
    masses = (measure([1.0, 3, 1, 2]), measure([2.0, 1, 1, 1, 4]))
    return sorting_player(measure(SOURCE), measure(TARGET), ALT, *masses)


@pytest.fixture
def file(tmp_path, player):
    return page_file(tmp_path, player)


def shown(page):
    data = page.locator(".sorting").evaluate("node => Object.assign({}, node.dataset)")
    return {name: float(data[name]) for name in ("cost", "least", "crossings")}


def least(x, y, p, a=None, b=None):
    return float(ot.emd2_1d(np.array(x), np.array(y), a, b, metric="minkowski", p=p))


def drawn(generator):
    """Two measures, with ties among the points and among the sums of their masses."""
    sides = []
    for _ in range(2):
        n = int(generator.integers(1, 9))
        masses = generator.integers(1, 5, size=n) + 0.0
        sides += [generator.uniform(0, 10, size=n).round(int(generator.integers(0, 3))), masses / masses.sum()]
    return sides


def test_arithmetic_agrees_with_pot_on_drawn_cases(context):
    generator, cases, wanted = np.random.default_rng(0), [], []
    for p in (1, 1.5, 2, 3):
        for _ in range(60):
            x, a, y, b = drawn(generator)
            cases.append([x.tolist(), a.tolist(), y.tolist(), b.tolist(), p])
            wanted.append(least(x, y, p, a, b))
    page = context.new_page()
    script = f"""cases => {{ {ARITHMETIC}
      const random = generator(1);
      return cases.map(([x, a, y, b, p]) => {{
        const best = sorted(x, a, y, b);
        let plan = couple(shuffled(x.length, random), a, shuffled(y.length, random), b);
        const costs = [cost(plan, x, y, p)], counts = [crossings(plan, x, y)];
        for (let k = 0; k < 200 && crossings(plan, x, y) > 0; k += 1) {{
          plan = uncrossed(plan, x, y);
          costs.push(cost(plan, x, y, p));
          counts.push(crossings(plan, x, y));
        }}
        const sums = x.map((_, i) => plan.reduce((s, [k,, m]) => s + (k === i ? m : 0), 0));
        return {{ best: cost(best, x, y, p), crossed: crossings(best, x, y), costs, counts, sums }};
      }});
    }}"""
    found = page.evaluate(script, cases)
    page.close()
    for (_, a, *_), ours, right in zip(cases, found, wanted):
        assert ours["best"] == pytest.approx(right, rel=1e-9, abs=1e-9)
        assert ours["crossed"] == 0
        # Uncrossing ends, never costs, keeps every point's mass, and arrives at the sorted cost.
        assert ours["counts"][-1] == 0
        assert (np.diff(ours["costs"]) <= 1e-9).all()
        assert ours["costs"][-1] == pytest.approx(right, rel=1e-9, abs=1e-9)
        np.testing.assert_allclose(ours["sums"], a, atol=1e-9)
    assert max(len(ours["counts"]) for ours in found) > 5


def test_a_dragged_grain_takes_its_pairing_along(file, context):
    with watched_page(context, file) as (page, troubles):
        assert page.locator(".sorting img").is_hidden()
        assert shown(page)["cost"] == pytest.approx(least(SOURCE, TARGET, 2), rel=1e-9)
        point = page.locator(".point").first
        box, row = point.locator(".body").bounding_box(), page.locator(".sorting svg").bounding_box()
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        unit = row["width"] / 640 * 57.2
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0] + 3 * unit, middle[1] + 40, steps=4)
        page.mouse.up()
        assert float(point.get_attribute("aria-valuenow")) == pytest.approx(4.0, abs=0.03)
        moved = [float(point.get_attribute("aria-valuenow")), *SOURCE[1:]]
        assert shown(page)["cost"] == pytest.approx(least(moved, TARGET, 2), rel=1e-9)
        page.mouse.move(*middle)
        assert float(point.get_attribute("aria-valuenow")) == moved[0]
        page.locator(".reset").click()
        assert shown(page)["cost"] == pytest.approx(least(SOURCE, TARGET, 2), rel=1e-9)
        assert troubles == []


def test_a_finger_drags_and_the_page_does_not_scroll_away(tmp_path, player, context):
    path = tmp_path / "page.html"
    path.write_text(f"<!doctype html><meta charset=utf-8><body>{player.html}<div style='height:3000px'>", "utf-8")
    with watched_page(context, path) as (page, troubles):
        page.set_viewport_size({"width": 400, "height": 800})
        touch = page.context.new_cdp_session(page)
        touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
        box = page.locator(".point .body").nth(3).bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for kind, places in (("Start", (x, y)), ("Move", (x + 30, y + 20)), ("Move", (x + 60, y))):
            point = {"x": places[0], "y": places[1]}
            touch.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": [point]})
            page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        unit = page.locator(".sorting svg").bounding_box()["width"] / 640 * 57.2
        reached = float(page.locator(".point").nth(3).get_attribute("aria-valuenow"))
        assert reached == pytest.approx(5.5 + 60 / unit, abs=0.03)
        assert page.evaluate("() => window.scrollY") == 0
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
        assert troubles == []


def test_keys_move_and_weigh_and_the_status_says_so(file, context):
    with watched_page(context, file) as (page, troubles):
        point = page.get_by_role("slider", name="source point 2")
        point.focus()
        for key in ("ArrowRight", "Shift+ArrowRight", "ArrowLeft", "ArrowLeft"):
            page.keyboard.press(key)
        assert float(point.get_attribute("aria-valuenow")) == pytest.approx(3.1)
        page.keyboard.press("End")
        assert float(point.get_attribute("aria-valuenow")) == 10
        page.keyboard.press("ArrowRight")
        assert float(point.get_attribute("aria-valuenow")) == 10
        page.keyboard.press("ArrowUp")
        assert page.locator(".masses").is_checked()
        a, b = np.array([1, 3.75, 1, 2]), np.array([2.0, 1, 1, 1, 4])
        moved = [1.0, 10.0, 2.9, 5.5]
        right = least(moved, TARGET, 2, a / a.sum(), b / b.sum())
        assert shown(page)["cost"] == pytest.approx(right, rel=1e-9)
        assert f"{right:.4g}" in page.get_by_role("status").text_content()
        assert "mass 0.484" in point.get_attribute("aria-valuetext")
        page.locator(".lighter").click()
        page.locator(".masses").uncheck()
        assert shown(page)["cost"] == pytest.approx(least(moved, TARGET, 2), rel=1e-9)
        assert troubles == []


def test_exponents_and_pairings_switch(file, context):
    with watched_page(context, file) as (page, troubles):
        assert page.locator(".uncross").is_disabled()
        for p in (1, 1.5, 3):
            page.get_by_role("radio", name=f"p = {p}", exact=True).check()
            assert shown(page)["cost"] == pytest.approx(least(SOURCE, TARGET, p), rel=1e-9)
        page.get_by_role("radio", name="random").check()
        first = shown(page)
        assert first["cost"] > first["least"]
        assert first["crossings"] > 0
        page.locator(".again").click()
        assert shown(page)["cost"] != first["cost"]
        while page.locator(".uncross").is_enabled():
            before = shown(page)["cost"]
            page.locator(".uncross").click()
            assert shown(page)["cost"] < before
        assert shown(page)["cost"] == pytest.approx(least(SOURCE, TARGET, 3), rel=1e-9)
        assert "0 crossings" in page.get_by_role("status").text_content()
        assert troubles == []


def test_without_scripts_the_still_stays(player):
    words = re.sub(r"<script>.*</script>", "", player.html, flags=re.DOTALL)
    assert words.count("<img") == 1
    assert '<div class="controls" hidden>' in words


def test_two_runs_give_the_same_page_that_reaches_nowhere(player):
    again = sorting_player(measure(SOURCE), measure(TARGET), ALT, measure([1.0, 3, 1, 2]), measure([2.0, 1, 1, 1, 4]))
    assert again.html == player.html
    assert repr(player) == "SortingPlayer(9 points; run the cell to move them)"
    outside = player.html.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"\{[{%]|https?:|src=\"(?!data:)|prefers-reduced|animat", outside)
    assert "&lt;points&gt;" in player.html
    assert ALT not in player.html
    data = json.loads(re.search(r"const data = (\{.*?\});\n", player.html)[1])
    assert data["source"] == SOURCE
    assert data["target_masses"] == [2, 1, 1, 1, 4]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"description": " "}, "description is empty"),
        ({"exponents": (0.5, 1)}, "sorting fails"),
        ({"exponents": ()}, "one or more"),
        ({"source": measure([11.0])}, "between 0 and 10"),
        ({"target": measure([])}, "between 0 and 10"),
        ({"source_masses": measure([1.0])}, "numbers > 0"),
        ({"target_masses": measure([0.0, 1, 1, 1, 1])}, "numbers > 0"),
    ],
)
def test_bad_requests_are_refused(unchecked, arguments, message):
    given = {"source": measure(SOURCE), "target": measure(TARGET), "description": ALT} | arguments
    with pytest.raises(ValueError, match=message):
        sorting_player(**given)
