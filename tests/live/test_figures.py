"""Every live figure in a browser without a network: it opens, answers each control, and moves only when asked."""

import gzip
import itertools
import math
import re
from importlib import resources

import numpy as np
import ot
import pytest
import scipy.ndimage
import skimage.measure
import torch
from live_pages import ANSWERS, BLOCK, DATA, DEPTHS, DISC, SCAN, SECTION, TISSUES, live_page_of

import meshot
from browser import AXE, UNREACHED, page_file, set_width, watched_page
from meshot.mesh import circle, even_points
from meshot.model import DeformationNetwork
from meshot.synth import TISSUES as TISSUE_NAMES, Appearance, t1_image
from meshot.view.page import joined
from meshot.volume import Volume, filled_cavities, genus_zero, largest_component
from meshot_book.examples.counterexample import crossing_sides
from meshot_book.figures.flows import FIELDS, outlines, two_triangles
from meshot_book.flows import descend
from meshot_book.live import Answer
from meshot_book.live.figure import figure_names
from refusals import refuses

ASSETS = "meshot_book/live/assets"
PICTURE = """() => document.querySelector('.plots').innerHTML + document.querySelector('.status').textContent
  + JSON.stringify(document.querySelector('.live-figure').state)"""
WIDTHS = (1280, 400)


@pytest.fixture
def opened(tmp_path, context):
    """Opens a figure at a width, and at the end has seen no trouble."""
    ends = []

    def open_figure(name, width=1280, **changed):
        watching = watched_page(context, page_file(tmp_path, live_page_of(name, **changed)))
        page, troubles = watching.__enter__()
        ends.append((watching, troubles))
        page.set_viewport_size({"width": width, "height": 900})
        page.reload()
        page.get_by_role("button", name="just show me").click()
        return page

    yield open_figure
    for watching, troubles in ends:
        assert troubles == []
        watching.__exit__(None, None, None)


def shown(page):
    data = page.locator(".live-figure").evaluate("node => Object.assign({}, node.dataset)")
    return {key: float(value) for key, value in data.items() if re.fullmatch(r"-?[\d.]+(e-?\d+)?", value)}


def status(page):
    return page.locator(".status").text_content()


def test_every_figure_is_tried():
    assert sorted(DATA) == figure_names()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", DATA)
def test_every_figure_answers_each_control(name, width, opened):
    page = opened(name, width)
    assert page.locator(".live-figure > img").is_hidden()
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert status(page).strip()
    steps = page.locator(".once").is_visible()
    controls = page.locator(".own :is(input, button)")
    unanswered = {number: controls.nth(number).evaluate("node => node.outerHTML") for number in range(controls.count())}
    assert unanswered or name == ""

    def try_controls():
        # A choice may switch others off: the last are tried first.
        for number in reversed(list(unanswered)):
            control = controls.nth(number)
            if control.is_disabled() or not control.is_visible():
                continue
            if steps:
                page.locator(".once").click()
            before = page.evaluate(PICTURE)
            kind = control.get_attribute("type")
            if kind == "range":
                control.focus()
                page.keyboard.press(
                    "ArrowLeft" if control.evaluate("node => node.value === node.max") else "ArrowRight"
                )
            else:
                control.click()
            if page.evaluate(PICTURE) != before:
                del unanswered[number]

    try_controls()
    for choice in 2 * [*range(controls.count())]:
        if unanswered and controls.nth(choice).get_attribute("type") == "radio" and controls.nth(choice).is_enabled():
            controls.nth(choice).click()
            try_controls()
    assert unanswered == {}
    page.locator(".reset").click()
    assert "undefined" not in page.inner_text("body")
    assert not re.search(r"\bNaN|Infinity", page.inner_text("body") + page.locator(".plots").inner_html())


@pytest.mark.parametrize("name", DATA)
def test_every_figure_has_no_barriers_and_its_points_move_by_keys(name, opened):
    for width in WIDTHS:
        page = opened(name, width)
        page.evaluate(resources.files("axe_playwright_python").joinpath("axe.min.js").read_text("utf-8"))
        page.evaluate("() => { document.documentElement.lang = 'en'; document.title = 'figure'; }")
        page.locator("details").evaluate("node => (node.open = true)")
        found = [each for each in page.evaluate(AXE, True) if not each.startswith(("landmark", "region", "page-has"))]
        assert found == []
        assert page.evaluate(UNREACHED) == []
    movables = page.locator(".movable")
    for number in range(movables.count()):
        movables.nth(number).focus()
        for key in ("PageDown", "ArrowLeft"):
            before = page.evaluate(PICTURE) + movables.nth(number).get_attribute("aria-valuetext")
            page.keyboard.press(key)
            after = page.evaluate(PICTURE) + movables.nth(number).get_attribute("aria-valuetext")
            assert after != before or (key == "PageDown" and movables.nth(number).get_attribute("aria-valuemax") == "1")


@pytest.mark.parametrize("name", DATA)
def test_nothing_moves_by_itself_and_play_ends_in_jumps_where_motion_is_reduced(name, opened):
    page = opened(name)
    before = page.evaluate(PICTURE)
    page.wait_for_timeout(120)
    assert page.evaluate(PICTURE) == before
    if not page.locator(".play").is_visible():
        return
    page.emulate_media(reduced_motion="reduce")
    page.evaluate(
        """() => {
          window.times = [];
          new MutationObserver(() => window.times.push(performance.now()))
            .observe(document.querySelector('.status'), { childList: true });
        }"""
    )
    page.locator(".play").click()
    page.wait_for_function("() => window.times.length > 1", timeout=20_000)
    assert "pause" in page.locator(".play").text_content()
    assert page.locator(".status").get_attribute("aria-live") == "off"
    page.locator(".play").click()
    times = np.diff(page.evaluate("() => window.times"))
    assert times.min() > 200  # jumps of half a second, seen late on a busy machine; a frame is 17 ms
    resting = page.evaluate(PICTURE)
    page.wait_for_timeout(600)
    assert page.evaluate(PICTURE) == resting
    # Out of sight it rests.
    page.locator(".play").click()
    page.evaluate("() => (document.body.style.paddingTop = '3000px')")
    page.wait_for_function("() => document.querySelector('.play').textContent.includes('play')", timeout=10_000)


def test_the_question_is_judged_when_asked(opened):
    page = opened("sorting")
    judge, verdict = page.locator(".judge"), page.locator(".verdict")
    assert judge.is_disabled()
    page.get_by_role("radio", name="no").check()
    assert "try it" in verdict.text_content()
    judge.click()
    assert verdict.text_content() == "Not so. It does: look again."
    page.get_by_role("radio", name="yes").check()
    judge.click()
    assert verdict.text_content() == "Right. It does."
    assert "Does <it> move?" in page.locator(".question legend").text_content()


def test_an_address_leads_back_to_what_was_seen(opened):
    page = opened("sorting")
    page.get_by_role("slider", name="exponent p").focus()
    page.keyboard.press("ArrowRight")
    page.get_by_role("slider", name="source points").focus()
    page.keyboard.press("ArrowRight")
    wanted = shown(page)
    page.locator(".link").click()
    assert "#sorting=" in page.url
    page.reload()
    assert shown(page) == wanted
    page.locator(".reset").click()
    assert shown(page) != wanted
    page.goto(page.url.split("#")[0] + "#sorting=%7Bbroken")
    page.reload()
    assert shown(page)["cost"] == pytest.approx(sorting_cost(2))


def test_a_figure_fills_the_screen_and_comes_back(opened):
    page = opened("turning")
    page.locator(".wide").click()
    page.wait_for_function("() => document.fullscreenElement?.dataset.figure === 'turning'")
    page.locator(".wide").click()
    page.wait_for_function("() => !document.fullscreenElement")


@pytest.mark.parametrize("name", DATA)
def test_without_scripts_the_still_stays_and_nothing_leads_outside(name):
    page = live_page_of(name)
    words = re.sub(r"<script>.*</script>", "", page.html, flags=re.DOTALL)
    assert words.count("<img") == 1
    assert len(re.findall(r'class="(?:question|plots|status|controls|keys|seen)"[^>]* hidden', words)) == 6
    outside = page.html.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"\{[{%]|https?:|src=\"(?!data:)", outside)
    assert "a &lt;figure&gt;" in page.html
    assert page.html == live_page_of(name).html
    assert repr(page) == f"LiveFigure({name!r}; run the cell to try it)"


def test_sizes():
    names = sorted(file.name for file in (resources.files("meshot_book") / "live" / "assets").iterdir())
    scripts = joined(*(f"{ASSETS}/{name}" for name in names if name.endswith(".js")))
    assert len(scripts.encode()) <= 150_000
    assert len(gzip.compress(scripts.encode())) <= 15_000
    for name in DATA:
        still = re.search(r'src="data:image/png;base64,([^"]*)"', live_page_of(name).html)[1]
        modules = [line for line in scripts.splitlines() if line]
        own = [line for line in live_page_of(name).html.replace(still, "").splitlines() if line not in modules]
        assert len("\n".join(own).encode()) <= 80_000


def test_requests_that_cannot_be_met(unchecked):
    refuses("there is no live figure 'sort'; there are: ", live_unknown)
    refuses("question is empty", live_page_of, "sorting", question=" ")
    refuses("seen is empty", live_page_of, "sorting", seen="")
    refuses("alt is empty", live_page_of, "sorting", alt="")
    refuses("0 of 2 answers are right", live_page_of, "sorting", answers=[Answer("a", "b"), Answer("c", "d")])
    refuses("1 of 4 answers are right", live_page_of, "sorting", answers=[*ANSWERS, *ANSWERS[1:], *ANSWERS[1:]])


def live_unknown():
    from meshot_book.live import live_figure

    live_figure("sort", {}, question="a", answers=ANSWERS, seen="b", still=None, alt="c")


# What single figures say, against the library and POT.


def sorting_cost(p, x=DATA["sorting"]["source"], a=None, b=None):
    return float(ot.emd2_1d(np.array(x), np.array(DATA["sorting"]["target"]), a, b, metric="minkowski", p=p))


def test_sorting_by_hand_finger_and_key(opened):
    page = opened("sorting", 400)
    points = page.get_by_role("slider", name="source points")
    assert shown(page)["cost"] == pytest.approx(sorting_cost(2), rel=1e-9)
    # By mouse.
    unit = page.locator(".plots svg").first.evaluate("s => s.getBoundingClientRect().width / s.viewBox.baseVal.width")
    length = page.locator(".plots svg").first.evaluate("s => s.viewBox.baseVal.width - 22") * unit / 10
    box = points.locator(".grip").first.bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 3 * length, middle[1] + 30, steps=4)
    page.mouse.up()
    x = page.locator(".live-figure").evaluate("node => node.state.source")
    assert x[0] == pytest.approx(4, abs=0.05)
    assert x[1:] == DATA["sorting"]["source"][1:]
    assert shown(page)["cost"] == pytest.approx(sorting_cost(2, x), rel=1e-9)
    # By finger: the page does not scroll away.
    page.evaluate(
        "() => document.body.append(Object.assign(document.createElement('div'), { style: 'height:3000px' }))"
    )
    touch = page.context.new_cdp_session(page)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
    box = points.locator(".grip").nth(3).bounding_box()
    u, v = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for kind, place in (("Start", (u, v)), ("Move", (u + 20, v + 20)), ("Move", (u + 50, v))):
        touch.send(
            "Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": [{"x": place[0], "y": place[1]}]}
        )
        set_width(page, 400)
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    moved = page.locator(".live-figure").evaluate("node => node.state.source[3]")
    assert moved == pytest.approx(5.5 + 50 / length, abs=0.05)
    assert page.evaluate("() => window.scrollY") == 0
    # By key, with masses.
    points.focus()
    for key in ("PageUp", "PageUp", "ArrowRight", "Shift+ArrowRight", "ArrowLeft", "ArrowUp"):
        page.keyboard.press(key)
    state = page.locator(".live-figure").evaluate("node => node.state")
    a, b = (np.array(state[key]) / np.sum(state[key]) for key in "ab")
    assert state["source"][1] == pytest.approx(2.2 + 1)
    assert state["a"][1] == 3.75
    assert state["unequal"]
    value = sorting_cost(2, state["source"], a, b)
    assert shown(page)["cost"] == pytest.approx(value, rel=1e-9)
    assert f"{value:.4g}" in status(page)


def test_sorting_p_pairings_and_ties(opened):
    page = opened("sorting")
    exponent = page.get_by_role("slider", name="exponent p")
    for p in ("1", "1.5", "4"):
        exponent.fill(p)
        assert shown(page)["cost"] == pytest.approx(sorting_cost(float(p)), rel=1e-9)
    page.get_by_role("radio", name="random").check()
    uncross = page.get_by_role("button", name="uncross one pair")
    assert shown(page)["cost"] > shown(page)["least"]
    while uncross.is_enabled():
        before = shown(page)["crossings"]
        uncross.click()
        assert shown(page)["crossings"] < before
    assert shown(page)["cost"] == pytest.approx(sorting_cost(4), rel=1e-9)
    # Two points at one position: the cost has two slopes there.
    page.locator(".reset").click()
    assert "no gradient" not in status(page)
    points = page.get_by_role("slider", name="source points")
    points.focus()
    page.keyboard.press("PageDown")
    for _ in range(7):
        page.keyboard.press("ArrowRight")
    assert page.locator(".live-figure").evaluate("node => node.state.source[1]") == 2.9
    assert "no gradient here" in status(page)
    left, right = (finite_slope(h) for h in (-1e-6, 1e-6))
    assert f"slope {left:.3g} to its left and {right:.3g} to its right".replace("-", "−") in status(page)


def finite_slope(h):
    return (sorting_cost(2, [1.0, 2.9 + h, 2.9, 5.5]) - sorting_cost(2, [1.0, 2.9, 2.9, 5.5])) / h


def test_turning_by_hand_and_key_against_the_library(opened):
    page = opened("turning")
    x, y = (np.array(DATA["turning"][name]) for name in ("source", "target"))

    def costs(degrees):
        radians = np.radians(degrees)
        return meshot.slice_costs(x, y, np.stack([np.cos(radians), np.sin(radians)], axis=1)).numpy()

    now = shown(page)
    assert now["cost"] == pytest.approx(costs([30])[0], rel=1e-9)
    assert now["mean"] == pytest.approx(costs(np.arange(180)).mean(), rel=1e-9)
    hand = page.get_by_role("slider", name="direction of the line")
    hand.focus()
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    assert shown(page)["angle"] == pytest.approx(34)
    assert shown(page)["cost"] == pytest.approx(costs([34])[0], rel=1e-9)
    box = page.locator(".plots svg").first.bounding_box()
    grip = hand.locator(".grip").bounding_box()
    page.mouse.move(grip["x"] + grip["width"] / 2, grip["y"] + grip["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20, steps=5)
    page.mouse.up()
    assert shown(page)["angle"] == pytest.approx(90, abs=1)
    # Estimates: the mean over the lines drawn, and its error.
    page.get_by_role("slider", name="how many").fill("100")
    errors = {}
    for kind in ("random", "orthogonal", "equally spaced"):
        page.get_by_role("radio", name=kind).check()
        page.locator(".reset").focus()
        found = []
        for _ in range(12):
            page.get_by_role("button", name="draw again").click()
            found.append(shown(page)["estimate"])
        errors[kind] = np.abs(np.array(found) - now["mean"]).mean()
        if kind != "equally spaced":
            spread = costs(np.arange(180)).std() / 10
            assert 0.02 * spread < shown(page)["error"] < 1.5 * spread
    assert errors["equally spaced"] < 0.01 * errors["random"]
    assert errors["orthogonal"] < errors["random"]


def test_chamfer_stops_before_the_target_and_exact_transport_does_not(opened):
    ends = {}
    page = opened("descent")
    for loss in ("Chamfer", "exact Wasserstein"):
        page.get_by_role("radio", name=loss).check()
        page.get_by_role("button", name="start again").click()
        for _ in range(120):
            page.locator(".once").click()
        ends[loss] = shown(page)
        assert ends[loss]["step"] == 120
    assert ends["Chamfer"]["exact"] > 20 * ends["exact Wasserstein"]["exact"]
    assert ends["Chamfer"]["alone"] > 0


def test_the_descent_draws_what_the_library_computes(opened):
    page = opened("descent")
    page.get_by_role("radio", name="sliced Wasserstein").check()
    page.get_by_role("radio", name="fixed").check()
    assert shown(page)["exact"] > 0
    chamfer = opened("descent")
    x = np.array(chamfer.locator(".live-figure").evaluate("node => node.state.points"))
    y = contour_points(np.array(DATA["descent"]["corners"]), len(x))
    assert shown(chamfer)["loss"] == pytest.approx(float(meshot.chamfer(x, y)), rel=1e-9)
    assert shown(chamfer)["exact"] == pytest.approx(float(meshot.wasserstein(x, y)), rel=1e-9)


def test_the_descent_goes_where_that_of_the_chapter_goes(opened):
    """Step size times n/2, as the chapter has it: the same path, and the same points for the same number of them."""
    page = opened("descent")
    x = torch.tensor(DATA["descent"]["points"], dtype=torch.float64)
    goal = meshot.DiscreteMeasure(torch.tensor(contour_points(np.array(DATA["descent"]["corners"]), len(x))))
    for steps in (1, 20):
        press = "(steps) => { while (steps--) document.querySelector('.once').click(); }"
        page.evaluate(press, steps)
    ended = descend(lambda points: meshot.chamfer(meshot.DiscreteMeasure(points), goal), x, 21, 0.05 * len(x) / 2, 0.9)
    assert shown(page)["step"] == 21
    assert shown(page)["loss"] == pytest.approx(float(meshot.chamfer(ended.points, goal.points)), rel=1e-9)
    assert shown(page)["exact"] == pytest.approx(float(meshot.wasserstein(ended.points, goal.points)), rel=1e-9)
    page.locator(".reset").click()
    before = page.locator(".live-figure").evaluate("node => node.state.points")
    for count in ("30", "24"):
        page.get_by_role("slider", name="points", exact=True).fill(count)
    after = page.locator(".live-figure").evaluate("node => node.state.points")
    np.testing.assert_allclose(before, DATA["descent"]["points"])
    np.testing.assert_allclose(after, before)
    page.get_by_role("slider", name="points", exact=True).fill("30")
    ring = even_points(circle(n_corners=3000), 30).numpy()
    np.testing.assert_allclose(page.locator(".live-figure").evaluate("node => node.state.points"), ring, atol=1e-5)


def contour_points(corners, n):
    """Points at equal distances along a closed polygon, from half a gap on."""
    ends = np.vstack([corners, corners[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1))])
    at = (np.arange(n) + 0.5) * along[-1] / n
    return np.stack([np.interp(at, along, ends[:, k]) for k in (0, 1)], axis=1)


SETTINGS = [
    (name, time, steps, exponent)
    for name, (time, steps), exponent in itertools.product(FIELDS, [(0.3, 8), (0.31, 8), (0.6, 1), (0.9, 64)], (0, 4))
]


def test_triangles_cross_where_python_says_so(opened):
    page, seen = opened("crossing", 400), set()
    for name, time, steps, exponent in SETTINGS:
        page.get_by_role("radio", name=name).check()
        for control, value in (("time", time), ("Euler steps", steps), ("pieces of each side", exponent)):
            page.get_by_role("slider", name=control, exact=True).fill(str(value))
        pairs = crossing_sides(outlines(FIELDS[name], two_triangles(), time, steps, 2**exponent))
        bound = time / steps * float(FIELDS[name].lipschitz_bound())
        assert shown(page)["pairs"] == pairs
        assert shown(page)["bound"] == pytest.approx(bound)
        assert ("No sides cross" in status(page)) is (pairs == 0)
        assert ("no two points" in status(page)) is (bound < 1)
        seen.add((pairs > 0, bound < 1))
    page.get_by_role("slider", name="strength").fill("2")
    assert shown(page)["bound"] == pytest.approx(2 * bound)
    assert seen == set(itertools.product((True, False), repeat=2))


def test_samples_of_spheres_approach_the_closed_form_below_the_bound(opened):
    page = opened("rates")
    slopes = {(2, 2): -0.5, (1, 2): -0.5, (2, 1): -1, (1, 1): -0.5, (3, 1): -1.5}
    for (p, radius), slope in slopes.items():
        page.get_by_role("radio", name=str(p), exact=True).check()
        page.get_by_role("slider", name="radius").fill(str(radius))
        page.evaluate("() => { for (let k = 0; k < 16; k += 1) document.querySelector('.once').click(); }")
        found = shown(page)
        # Concentric spheres: a uniform distribution on an interval along every line.
        assert found["truth"] == pytest.approx((radius - 1) ** p / (p + 1), abs=1e-12)
        assert 0 < found["error"] < found["bound"]
        assert found["bound"] == pytest.approx(p * (2 * radius) ** (p - 1) * (2 + 2 * radius) * math.pi / 8 / 10)
        assert found["slope"] == pytest.approx(slope, abs=0.2)
    page.get_by_role("radio", name="2", exact=True).check()
    page.get_by_role("slider", name="distance").fill("2")
    lines = page.evaluate(
        f"() => {{ {joined(f'{ASSETS}/projection.js')} return sphereDirections(6, 3, generator(1)); }}"
    )
    assert shown(page)["truth"] == pytest.approx(np.mean((2 * np.array(lines)[:, 0]) ** 2), rel=1e-9)


def test_the_calculator_interpolates_and_says_what_was_not_measured(opened):
    page = opened("calculator")
    for size, count in (("3", 1000), ("4.5", 31623), ("6", 1_000_000)):
        page.get_by_role("slider", name="supports").fill(size)
        assert shown(page)["count"] == count
        assert shown(page)["seconds"] == pytest.approx(count / 1e6, rel=1e-9)
        assert shown(page)["megabytes"] == pytest.approx(3 * count / 1e4, rel=1e-9)
    assert "1,000 steps 17 minutes" in status(page)
    page.get_by_role("radio", name="compares").check()
    assert shown(page)["seconds"] == -1
    assert "not measured here (stopped at 100,000: time: 10000 s foretold)" in status(page)


def test_a_planted_error_is_shown_after_the_guess_and_judged_by_its_floor(opened):
    page = opened("planted")
    data = DATA["planted"]
    above, below = (page.get_by_role("button", name=f"I guess: {word}", exact=True) for word in ("above", "not above"))
    size, bars = page.get_by_role("slider", name="size"), page.locator(".plots svg").nth(2)
    assert "Is the error above all ten?" in status(page)
    assert "value" not in shown(page)
    assert shown(page)["floor"] == pytest.approx(np.mean(data["floors"]["EMD"][1]), rel=1e-12)
    assert shown(page)["spread"] == pytest.approx(np.std(data["floors"]["EMD"][1], ddof=1), rel=1e-12)
    before = bars.locator("path").count()
    above.click()
    assert bars.locator("path").count() == before + 3
    colours = [bar.get_attribute("stroke") for bar in bars.locator("path[stroke-width='14']").all()]
    assert colours == ["var(--grey)", "var(--blue)", "var(--blue)"]
    assert "right. So far 1 of 1." in status(page)
    assert "2.5 mm, the target with itself 1 ± 0.15 mm. Above all ten." in status(page)
    assert "Detected at 20,000 points by ASSD, crossing." in status(page)  # 2.01 is above twice, null is infinite
    assert above.is_disabled()
    assert below.is_disabled()
    # The largest value of the floor is not above the floor; twice the reference is not detected.
    size.fill("0")
    assert "Is the error above all ten?" in status(page)
    above.click()
    assert "Not above all ten. Your guess is wrong. So far 1 of 2. Detected at 20,000 points by none." in status(page)
    page.get_by_role("radio", name="20,000").check()
    assert "not measured" in status(page)
    assert above.is_disabled()
    page.get_by_role("radio", name="ASSD").check()
    page.get_by_role("radio", name="nothing").check()
    page.get_by_role("radio", name="1,000").check()
    assert size.is_disabled()
    below.click()
    assert "0 mm, the target with itself 0. Not above all ten. Your guess is right. So far 2 of 3." in status(page)
    # Without guesses, as a lecturer goes through the errors.
    page.get_by_role("radio", name="at once").check()
    page.get_by_role("radio", name="shift").check()
    size.fill("2")
    page.get_by_role("radio", name="exact").check()
    assert page.get_by_role("radio", name="1,000").is_disabled()
    assert (shown(page)["value"], shown(page)["above"]) == (0.55, 1)
    widths = [path.bounding_box()["width"] for path in bars.locator("path[stroke-width='14']").all()]
    assert widths[0] / widths[1] == pytest.approx(math.log10(400) / 3, rel=0.01)  # at most a hundred times
    assert widths[1] == pytest.approx(widths[2], rel=1e-6)


def test_errors_rise_above_a_floor_as_it_falls(opened):
    page = opened("floors")
    floors, levels = DATA["floors"]["floors"], DATA["floors"]["levels"]
    assert status(page).endswith("0 of 3 errors are expected above it: none.")
    seen = set()
    for metric, sizes in (("SWD", (3, 3.7, 5)), ("EMD", (3, 3.9, 3.95, 5)), ("ASSD", (4,))):
        page.get_by_role("radio", name=metric).check()
        for size in sizes:
            page.get_by_role("slider", name="points").fill(str(size))
            count, known = round(10**size), floors[metric]
            mean = spread = 0
            if known["m"] and count <= known["m"][-1]:
                logs = [np.log(known[key]) for key in ("m", "mean", "spread")]
                mean, spread = (np.exp(np.interp(np.log(count), logs[0], one)) for one in logs[1:])
            elif known["m"]:
                mean = np.sqrt(known["area"] * (np.log(count) + known["c"]) / (2 * np.pi * count))
                spread = mean * known["spread"][-1] / known["mean"][-1]
                assert "extrapolated" in status(page)
            expected = np.hypot(list(levels[metric].values()), mean)
            above = [name for name, value in zip(levels[metric], expected) if value > mean + 2 * spread + 1e-9]
            assert shown(page)["count"] == count
            assert shown(page)["mean"] == pytest.approx(mean, rel=1e-9)
            assert shown(page)["spread"] == pytest.approx(spread, rel=1e-9)
            assert shown(page)["shift"] == pytest.approx(expected[0], rel=1e-9)
            assert status(page).endswith(f"above it: {', '.join(above) or 'none'}.")
            seen.add((metric, len(above)))
    assert seen == {("SWD", 0), ("SWD", 1), ("EMD", 0), ("ASSD", 2)}


def test_handles_over_the_threshold_and_what_the_repair_gives_up(opened):
    page = opened("threshold", 400)
    depths = (DEPTHS - 50) / 10
    priorities = {
        "fraction": BLOCK / 100 + 1e-6 * depths,
        "depth": depths,
        "depth and fraction": depths + 12 * BLOCK / 100,
    }
    seen = []
    for threshold in (5, 35, 50, 65, 95):
        page.get_by_role("slider", name="threshold").fill(str(threshold))
        around = np.pad(threshold < BLOCK, 1)
        for touch, connectivity in (("a face, edge or corner", 3), ("a face", 1)):
            page.get_by_role("radio", name=touch, exact=True).check()
            inside, outside = (scipy.ndimage.generate_binary_structure(3, k) for k in (connectivity, 4 - connectivity))
            components = scipy.ndimage.label(around, inside)[1]
            cavities = scipy.ndimage.label(~around, outside)[1] - 1
            handles = components + cavities - skimage.measure.euler_number(around, connectivity=connectivity)
            found = shown(page)
            assert [found[key] for key in ("components", "cavities", "handles")] == [components, cavities, handles]
            assert f"{components} component" in status(page)
            seen.append(handles)
        whole = filled_cavities(largest_component(threshold < BLOCK))
        for name, priority in priorities.items():
            page.get_by_role("radio", name=name, exact=True).check()
            lost = int((whole & ~genus_zero(whole, priority.astype(float))).sum())
            assert (shown(page)["size"], shown(page)["lost"]) == (whole.sum(), lost)
    assert max(seen) > 3


def ring(angle, narrowing):
    """The mask of the live figure ``repair``, and the depth in it."""
    i, k = np.indices((19, 19)) - 9
    theta = np.arctan2(k, i)
    away = np.angle(np.exp(1j * (theta - np.radians(angle))))
    half = 2.2 + 0.5 * np.cos(theta - np.pi) - narrowing * np.exp(-((away / 0.5) ** 2))
    depth = (half - np.abs(np.hypot(i, k) - 6)).round(6)[:, :, None]
    return depth > 0, depth


def test_a_ring_is_cut_where_the_library_cuts_it(opened):
    page = opened("repair")
    assert (shown(page)["handles"], shown(page)["ball"]) == (1, 0)
    i, k = np.indices((19, 19)) - 9
    nearness = -np.hypot(i + 6, k).round(6)[:, :, None]
    cuts = {}
    for narrowing in (1.2, 0):
        page.get_by_role("slider", name="narrowing").fill(str(narrowing))
        mask, depth = ring(60, narrowing)
        for name, priority in (
            ("depth", depth),
            ("nearness to the start", nearness),
            ("the same for all", 0.0 * depth),
        ):
            page.get_by_role("radio", name=name).check()
            assert shown(page)["ball"] == 0
            page.get_by_role("button", name="to the end").click()
            lost = mask & ~genus_zero(mask, priority)
            found = shown(page)
            assert (found["size"], found["ball"]) == (mask.sum(), mask.sum() - lost.sum())
            assert (found["handles"], found["now"], found["ended"]) == (1, 0, 1)
            places = np.argwhere(lost[:, :, 0]) - 9
            middle = (places / np.linalg.norm(places, axis=1, keepdims=True)).sum(axis=0)
            assert found["cut"] == pytest.approx(np.degrees(np.arctan2(middle[1], middle[0])) % 360, abs=1e-6)
            cuts[narrowing, name] = found["cut"]
    assert abs(cuts[1.2, "depth"] - 60) < 12
    assert min(cuts[0, "depth"], 360 - cuts[0, "depth"]) < 25  # the thinnest place is opposite the start
    assert min(cuts[1.2, "nearness to the start"], 360 - cuts[1.2, "nearness to the start"]) < 25
    # The same by hand: the ring is cut where its narrow place is moved to.
    page.get_by_role("radio", name="depth").check()
    page.get_by_role("slider", name="narrowing").fill("1.2")
    page.get_by_role("slider", name="the narrow place").focus()
    for _ in range(6):
        page.keyboard.press("ArrowRight")
    assert "at 30 degrees" in page.get_by_role("slider", name="the narrow place").get_attribute("aria-valuetext")
    page.locator(".once").click()
    assert shown(page)["ball"] == 1
    page.get_by_role("button", name="to the end").click()
    assert abs(shown(page)["cut"] - 30) < 12


def border_error(image, size, side=24, edge=2, piece=0.5):
    """Mean distance of the level half-way between 440 and 310 from the border of the disc, both ways, in mm."""
    halfway = [size * (line + 0.5) for line in skimage.measure.find_contours(image, 375)]
    lines = [
        np.concatenate([np.stack([one[:-1], one[1:]], axis=1) for one in many])
        for many in (halfway, [12 + DISC * 0.03])
    ]
    means = []
    for one, other in (lines, lines[::-1]):
        long = np.linalg.norm(one[:, 1] - one[:, 0], axis=1)
        counts = np.maximum(1, np.ceil(long / piece)).astype(int)
        shares = np.concatenate([(np.arange(count) + 0.5) / count for count in counts])[:, None]
        start, end = (np.repeat(one[:, k], counts, axis=0) for k in (0, 1))
        places, weights = start + shares * (end - start), np.repeat(long / counts, counts)
        inner = ((places > edge) & (places < side - edge)).all(axis=1)
        way = other[:, 1] - other[:, 0]
        along = ((places[:, None] - other[:, 0]) * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-300)
        feet = other[:, 0] + np.clip(along, 0, 1)[:, :, None] * way
        away = np.linalg.norm(places[:, None] - feet, axis=2).min(axis=1)
        means.append(np.average(away[inner], weights=weights[inner]))
    return np.mean(means)


def test_the_scanner_of_the_figure_is_that_of_the_library(opened):
    page = opened("imaging")
    page.get_by_role("slider", name="noise σ").fill("0")
    for size, blur, bias in ((0.5, 0, 0), (1, 2.5, 0), (2, 1.2, 20), (3, 4, 40)):
        page.get_by_role("radio", name=str(size), exact=True).check()
        page.get_by_role("slider", name="blur, FWHM").fill(str(blur))
        page.get_by_role("slider", name="bias").fill(str(bias))
        n = int(24 / size)
        parts = {
            name: part.round(2).reshape(n, 48 // n, n, 48 // n).mean(axis=(1, 3)) for name, part in TISSUES.items()
        }
        gain = np.exp(bias / 100 * (2 * np.arange(n) + 1 - n) / n)[:, None]
        for picture, factor, width in (("blur", 1, blur), ("bias", gain, 0), ("all", gain, blur)):
            grid = Volume(np.zeros((n, 1, n)), np.diag([size, size, size, 1.0]))
            seen = dict.fromkeys(TISSUE_NAMES, np.zeros((n, 1, n)))
            seen |= {name: (part * factor)[:, None] for name, part in parts.items()}
            means = dict.fromkeys(TISSUE_NAMES, 0.0) | {"white": 440.0, "grey": 310.0}
            look = Appearance(means, texture=0.0, bias=0.0, blur_mm=width, noise=0.0)
            image = t1_image(seen, grid, look, 0).data[:, 0].astype(float)
            page.get_by_role("radio", name=picture, exact=True).check()
            assert shown(page)["mean"] == pytest.approx(image.mean(), rel=1e-6)
            assert shown(page)["power"] == pytest.approx((image**2).mean(), rel=1e-6)
            assert shown(page)[picture] == pytest.approx(border_error(image, size), abs=2e-5)
    # Noise: the mean square of a magnitude grows by twice the variance, and another draw is another image.
    page.locator(".reset").click()
    page.get_by_role("radio", name="0.5", exact=True).check()
    page.get_by_role("radio", name="voxels alone").check()
    quiet = shown(page)
    page.get_by_role("radio", name="noise").check()
    noisy = shown(page)
    assert noisy["power"] - quiet["power"] == pytest.approx(2 * 25**2, rel=0.5)
    assert noisy["noise"] > quiet["plain"]
    page.get_by_role("button", name="other noise").click()
    assert shown(page)["power"] != noisy["power"]
    assert shown(page)["power"] - quiet["power"] == pytest.approx(2 * 25**2, rel=0.5)
    assert "contrast to noise 5.2." in status(page)


def test_the_cubes_of_a_vertex_are_those_of_the_network(opened):
    page = opened("cubes")
    data = DATA["cubes"]
    border = np.reshape(data["border"], (-1, 2))
    # One feature for each voxel of the middle plane of a cube.
    cubes = DeformationNetwork(width=25, hidden=(4,), n_scales=3, size=5).cubes
    images, held = cubes.images(SCAN), []
    for along, offset in ((20, -5), (20, -9.5), (20, 0), (77, 3.5), (50, 12)):
        page.get_by_role("slider", name="along the border").fill(str(along))
        page.get_by_role("slider", name="along the normal").fill(str(offset))
        found = shown(page)
        normal = (border[along] - 14.25) / np.linalg.norm(border[along] - 14.25)
        place = border[along] + offset * normal
        np.testing.assert_allclose([found["x"], found["z"]], place, atol=0.06)
        for scale, level in enumerate(data["levels"]):
            image = np.array([int(level["values"][k : k + 2]) / 100 for k in range(0, len(level["values"]), 2)])
            image, step = image.reshape(level["shape"]), np.array(level["step"])
            voxels = np.moveaxis(np.indices((5, 5)), 0, -1).reshape(-1, 2) - 2
            where = ([found["x"], found["z"]] - np.array(level["origin"])) / step + voxels
            values = scipy.ndimage.map_coordinates(image, where.T, order=1, mode="grid-constant")
            assert found[f"range{scale}"] == pytest.approx(np.ptp(values), abs=1e-9)
            with torch.no_grad():
                cubes.weight.zero_()
                for k, (i, j) in enumerate(voxels + 2):
                    cubes.weight[k, scale, i, 2, j] = 1
                at = torch.tensor([[found["x"], SECTION, found["z"]]], dtype=cubes.weight.dtype)
                features = cubes.at(cubes.maps(images), at)[0].numpy()
            np.testing.assert_allclose(values, features, atol=0.0051)
            inside = (np.abs(border - [found["x"], found["z"]]) <= 2.5 * step).all(axis=1).any()
            assert found[f"holds{scale}"] == inside
            held.append(inside)
    assert held[:3] == [False, True, True]
    # A vertex that is dragged stays beside the border.
    page.get_by_role("slider", name="the vertex").focus()
    page.keyboard.press("Shift+ArrowUp")
    state = page.locator(".live-figure").evaluate("node => node.state")
    assert state["along"] != 50
    assert "the border. Cubes of 7.5 mm: " in status(page)
