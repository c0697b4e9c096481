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
from live_pages import ANSWERS, BLOCK, BY_KIND, DATA, DEPTHS, DISC, SCAN, SECTION, TISSUES, live_page_of
from scipy import stats
from scipy.optimize import linear_sum_assignment
from scipy.special import ive
from skimage.measure import find_contours
from test_numbers import edges_of, mean_distance, mulberry, weighted_cosine

import meshot
from browser import AXE, SET_THEME, UNREACHED, page_file, set_width, watched_page
from meshot.flow import integrate
from meshot.loss import energy_sliced_wasserstein, max_sliced_direction
from meshot.loss.exact import projected_law
from meshot.mesh import circle, even_points, split_in_four
from meshot.model import DeformationNetwork
from meshot.synth import TISSUES as TISSUE_NAMES, Appearance, t1_image
from meshot.view.page import joined
from meshot.volume import Volume, filled_cavities, genus_zero, largest_component
from meshot_book.examples import Drifting
from meshot_book.examples.counterexample import crossing_sides
from meshot_book.figures.cortex import live_numbers
from meshot_book.figures.flows import FIELDS, outlines, two_triangles
from meshot_book.flows import Vortex, descend
from meshot_book.live import Answer
from meshot_book.live.figure import figure_names
from meshot_book.statistics import people_needed, power_of_groups
from refusals import refuses

ASSETS = "meshot_book/live/assets"
PICTURE = """() => document.querySelector('.plots').innerHTML + document.querySelector('.status').textContent
  + JSON.stringify(document.querySelector('.live-figure').state)"""
UNDEFINED = """() => Object.entries(document.querySelector('.live-figure').state)
  .filter(([, value]) => value === undefined || Number.isNaN(value)).map(([key]) => key)"""
WIDTHS = (1280, 400)
#: Rules about what a whole page has, which a figure alone has not.
ELSEWHERE = ("landmark", "region", "page-has")
#: Counts what a script asks to be called later.
COUNT_CALLS = """() => {
  window.calls = 0;
  for (const name of ["requestAnimationFrame", "setTimeout", "setInterval", "requestIdleCallback"]) {
    const original = window[name].bind(window);
    window[name] = (...given) => ((window.calls += 1), original(...given));
  }
}"""


@pytest.fixture
def opened(tmp_path, context):
    """Opens a figure at a width, and at the end has seen no trouble."""
    ends = []

    def open_figure(name, width=1280, motion="no-preference", **changed):
        watching = watched_page(context, page_file(tmp_path, live_page_of(name, **changed)))
        page, troubles = watching.__enter__()
        ends.append((watching, troubles))
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(reduced_motion=motion)
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


@pytest.mark.parametrize("width", [1280, pytest.param(400, marks=pytest.mark.thorough)])
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
    assert page.evaluate(UNDEFINED) == []
    page.locator(".reset").click()
    assert "undefined" not in page.inner_text("body")
    assert not re.search(r"\bNaN|Infinity", page.inner_text("body") + page.locator(".plots").inner_html())


@pytest.mark.parametrize("name", DATA)
def test_every_figure_has_no_barriers_and_its_points_move_by_keys(name, opened):
    for width in WIDTHS:
        page = opened(name, width)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        page.evaluate(resources.files("axe_playwright_python").joinpath("axe.min.js").read_text("utf-8"))
        page.evaluate("() => { document.documentElement.lang = 'en'; document.title = 'figure'; }")
        page.locator("details").evaluate("node => (node.open = true)")
        for theme, ground in (("light", "#fff"), ("dark", "#14181e")):
            page.evaluate(SET_THEME, theme)
            page.evaluate("ground => (document.body.style.background = ground)", ground)
            found = [f"{theme}: {each}" for each in page.evaluate(AXE, True) if not each.startswith(ELSEWHERE)]
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


@pytest.mark.parametrize("motion", ["no-preference", pytest.param("reduce", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("name", DATA)
def test_nothing_moves_by_itself(name, motion, opened):
    page = opened(name, motion=motion)
    assert page.evaluate("() => window.matchMedia('(prefers-reduced-motion: reduce)').matches") is (motion == "reduce")
    before = page.evaluate(PICTURE)
    page.evaluate(COUNT_CALLS)
    page.wait_for_timeout(700)  # longer than the jump of half a second
    assert page.evaluate(PICTURE) == before
    assert page.evaluate("() => window.calls") == 0
    assert page.evaluate("() => document.getAnimations().length") == 0


@pytest.mark.parametrize("name", BY_KIND)
def test_nothing_runs_out_of_sight(name, opened):
    page = opened(name)
    if not page.locator(".play").is_visible():
        return
    page.evaluate(COUNT_CALLS)
    page.locator(".play").click()
    page.wait_for_function("() => window.calls > 2")
    page.evaluate("() => (document.body.style.paddingTop = '3000px')")
    page.wait_for_function("() => document.querySelector('.play').textContent.includes('play')", timeout=10_000)
    resting, calls = page.evaluate(PICTURE), page.evaluate("() => window.calls")
    page.wait_for_timeout(200)
    assert page.evaluate("() => window.calls") == calls
    assert page.evaluate(PICTURE) == resting
    # It rests because it is not seen, not because it had come to its end.
    page.evaluate("() => (document.body.style.paddingTop = '')")
    page.locator(".play").click()
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert "pause" in page.locator(".play").text_content()


@pytest.mark.parametrize("name", BY_KIND)
def test_play_goes_in_jumps_where_motion_is_reduced(name, opened):
    page = opened(name, motion="reduce")
    if not page.locator(".play").is_visible():
        return
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
    assert len(gzip.compress(scripts.encode())) <= 25_000
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
    # Each draw is a new one.
    drawn = set()
    for _ in range(5):
        page.get_by_role("button", name="draw again").click()
        drawn.add(shown(page)["estimate"])
    assert len(drawn) == 5
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
        page.evaluate("n => { while (n--) document.querySelector('.once').click(); }", 120)
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


def test_flows_there_and_back_are_those_of_the_library(opened):
    page = opened("inverse")
    data = DATA["inverse"]
    points = torch.tensor(data["points"], dtype=torch.float64)
    drift = torch.tensor(data["drift"], dtype=torch.float64)
    largest = lambda one, other: float((one - other).norm(dim=1).max())  # noqa: E731
    for strength, method, exponent in itertools.product((2, 4), ("Euler", "Midpoint", "RK4"), (0, 3, 5)):
        page.get_by_role("radio", name=str(strength), exact=True).check()
        page.get_by_role("radio", name=method, exact=True).check()
        page.get_by_role("slider", name="steps each way").fill(str(exponent))
        field, n = Drifting(Vortex(float(strength), data["reach"]), drift), 2**exponent
        there = integrate(field, points, n, method.lower())
        back = integrate(field, there, n, method.lower(), True)
        found = shown(page)
        assert found["flow"] == pytest.approx(largest(there, field.flow(points)), rel=1e-9, abs=1e-13)
        assert found["back"] == pytest.approx(largest(back, points), rel=1e-9, abs=1e-13)
        assert found["now"] == pytest.approx(found["back"], rel=1e-9, abs=1e-13)
    page.locator(".reset").click()
    page.get_by_role("slider", name="steps each way").fill("4")
    assert shown(page)["ratio"] == pytest.approx(8, rel=0.05)  # one order more than that of the flow
    page.get_by_role("slider", name="time").fill("1")
    assert shown(page)["taken"] == 16
    assert "after 16 of 32 steps" in status(page)


@pytest.mark.parametrize("start", ["even", "uneven"])
def test_contours_descend_as_autograd_has_it(start, opened):
    page = opened("contour")
    page.get_by_role("radio", name=start, exact=True).check()
    page.get_by_role("slider", name="averaged").fill("0.5")
    page.evaluate("() => { for (let k = 0; k < 12; k += 1) document.querySelector('.once').click(); }")
    found = shown(page)
    data = DATA["contour"]
    angles = math.pi * (np.arange(data["lines"]) + 0.5) / data["lines"]
    lines = torch.tensor(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    goal = edges_of(torch.tensor(data["target"], dtype=torch.float64))
    losses = {
        "chamfer": (0.5, lambda measure: meshot.chamfer(measure, goal)),
        "sliced": (2.0, lambda measure: meshot.sliced_wasserstein(measure, goal, lines)),
    }
    for name, (unit, loss) in losses.items():
        x = torch.tensor(data["starts"][start], dtype=torch.float64)
        path = [judged_contour(x)]
        gaps = np.minimum(np.arange(len(x)), len(x) - np.arange(len(x)))
        kernel = np.exp(-2 * gaps**2)
        for _ in range(12):
            x = x.requires_grad_()
            measure = edges_of(x)
            (gradient,) = torch.autograd.grad(unit * loss(measure), x)
            masses = measure.weights.detach()
            arrows = -gradient / (masses + masses.roll(1))[:, None]
            arrows = sum(w * arrows.roll(-k, 0) for k, w in enumerate(kernel / kernel.sum()))
            x = x.detach() + 0.1 * arrows
            path.append(judged_contour(x))
        assert found[name] == pytest.approx(path[-1][0], rel=1e-9)
        assert found[f"{name}Varies"] == pytest.approx(path[-1][1], rel=1e-9, abs=1e-12)
        at_level = next(varies for distance, varies in path if distance <= found["level"] * (1 + 1e-12))
        assert found[f"{name}AtLevel"] == pytest.approx(at_level, rel=1e-9, abs=1e-12)
    assert found["level"] == max(found["chamfer"], found["sliced"])


def test_contours_show_what_the_reader_should_see(opened):
    page = opened("contour")

    def after(steps, start, width):
        page.get_by_role("radio", name=start, exact=True).check()
        page.get_by_role("slider", name="averaged").fill(width)
        page.evaluate("(n) => { while (n--) document.querySelector('.once').click(); }", steps)
        return shown(page)

    found = after(100, "even", "0")
    assert 2.5 * found["slicedAtLevel"] < found["chamferAtLevel"]
    averaged = after(100, "even", "1")
    assert averaged["slicedAtLevel"] < averaged["chamferAtLevel"] < 0.6 * found["chamferAtLevel"]
    # Neither makes uneven edges even: 0.42 at the start.
    uneven = after(150, "uneven", "0")
    assert min(uneven["slicedVaries"], uneven["chamferVaries"]) > 0.4
    assert max(uneven["sliced"], uneven["chamfer"]) < 0.5


def judged_contour(vertices):
    lengths = (vertices.roll(-1, 0) - vertices).norm(dim=1).detach()
    return mean_distance(vertices.detach().numpy(), np.array(DATA["contour"]["target"])), float(
        lengths.std(unbiased=False) / lengths.mean()
    )


@pytest.mark.parametrize(("p", "phase"), [(1, 0.25), (2, 0.25), (1, 0.5)])
def test_windows_and_the_whole_follow_what_is_needed_as_the_library_says(p, phase, opened):
    page = opened("windows")
    data = DATA["windows"]
    page.get_by_role("radio", name={0.25: "a quarter of a wave", 0.5: "half a wave"}[phase]).check()
    page.get_by_role("radio", name=str(p), exact=True).check()
    x = ((np.arange(data["points"]) + 0.5) / data["points"] - 0.5) * data["width"]
    sheets = [
        torch.tensor(np.stack([x, data["height"] * np.cos(2 * np.pi * (x / data["wave"] + s))], axis=1))
        for s in (0, phase)
    ]
    angles = math.pi * (np.arange(data["lines"]) + 0.5) / data["lines"]
    lines = torch.tensor(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    needed = (sheets[1] - sheets[0]).numpy()
    centres = sheets[1][data["first"] :: data["every"]]
    in_all = lines[None].expand(len(centres), -1, -1)
    even = torch.full((len(x),), 1 / len(x), dtype=torch.float64)
    goal, seen = meshot.DiscreteMeasure(sheets[1], even), []
    for radius, surplus in ((3, 10), (8, 10), (8, 0), (24, 30)):
        page.get_by_role("slider", name="radius").fill(str(radius))
        page.get_by_role("slider", name="surplus").fill(str(surplus))
        masses = torch.tensor(np.where(x < 0, 1 + surplus / 100, 1 - surplus / 100))
        masses = masses / masses.sum()

        def cosine_and_value(loss, masses=masses):
            moving = sheets[0].clone().requires_grad_()
            value = loss(meshot.DiscreteMeasure(moving, masses))
            (gradient,) = torch.autograd.grad(value, moving)
            return weighted_cosine((-gradient / masses[:, None]).numpy(), needed, masses.numpy()), value.item()

        found = shown(page)
        whole, cost = cosine_and_value(lambda m: meshot.sliced_wasserstein(m, goal, lines, p))
        windows, local = cosine_and_value(
            lambda m, r=radius: meshot.windowed_sliced_wasserstein(m, goal, centres, r, in_all, p)
        )
        balanced = float(meshot.sliced_wasserstein(meshot.DiscreteMeasure(sheets[0], even), goal, lines, p))
        assert found["cost"] == pytest.approx(cost, rel=1e-9)
        assert found["local"] == pytest.approx(local, rel=1e-9)
        assert found["share"] == pytest.approx(balanced / cost, rel=1e-9)
        assert found["whole"] == pytest.approx(whole, abs=1e-9)
        assert found["windows"] == pytest.approx(windows, abs=1e-9)
        seen.append(found)
    # A surplus turns the arrows of the whole away from what is needed, and those in windows less.
    assert seen[0]["whole"] < 0.25 < 0.65 < seen[0]["windows"]
    assert seen[2]["whole"] > 0.55
    assert seen[0]["share"] > 2 * seen[0]["whole"] or p == 2


def points_and_normals(points, flipped=None):
    """Points with their normals, ten units long and from the origin, and inwards where flipped."""
    sign = 1 if flipped is None else np.where(flipped, -1, 1)[:, None]
    return np.hstack([points, sign * 10 * points / np.linalg.norm(points, axis=1, keepdims=True)])


def shifts_and_longest(x, y, lines, blur, reach=math.inf):
    """Equivalent shift of four losses, and the longest descent direction, in positions: by POT and the library."""
    n, d = x.shape
    costs = np.minimum(((x[:, None] - y) ** 2).sum(axis=2), reach**2)
    plan = ot.emd([], [], costs)
    partial = 2 * np.where(costs < reach**2, plan, 0)[:, :, None] * (x[:, None] - y)

    def entropic(u, v):
        c = ((u[:, None] - v) ** 2).sum(axis=2)
        plan = ot.sinkhorn([], [], c, 2 * blur**2, method="sinkhorn_log", stopThr=1e-13, numItermax=100_000)
        kl = (plan * np.log(np.maximum(plan, 1e-300) * n * n)).sum()
        return (plan * c).sum() + 2 * blur**2 * kl, plan

    (across, there), (own, here), (other, _) = (entropic(*pair) for pair in ((x, y), (x, x), (y, y)))
    smooth = 2 * (here @ x - there @ y)
    found = {"exact": ((costs * plan).sum(), partial.sum(axis=1)), "Sinkhorn": (across - (own + other) / 2, smooth)}
    lines = torch.tensor(lines, dtype=torch.float64)
    losses = {"Chamfer": meshot.chamfer, "sliced": lambda u, v: meshot.sliced_wasserstein(u, v, lines)}
    for name, loss in losses.items():
        places = torch.tensor(x, requires_grad=True)
        value = loss(places, torch.tensor(y))
        found[name] = value.item(), torch.autograd.grad(value, places)[0].numpy()
    factors = {"Chamfer": 0.5, "sliced": d}
    return {
        name: (
            math.sqrt(max(0, factors.get(name, 1) * value)),
            factors.get(name, 1) * n / 2 * np.linalg.norm(gradient[:, :2], axis=1),
        )
        for name, (value, gradient) in found.items()
    }


def test_the_arrows_of_four_losses_are_those_of_the_library(opened):
    page, data = opened("scene", 400), DATA["scene"]

    def agrees(scene, y, normals=False, blur=10, reach=math.inf):
        x = np.array(data["scenes"][scene]["source"])
        if normals:
            x, y = points_and_normals(x), points_and_normals(np.array(y), data["scenes"][scene]["flipped"])
        right = shifts_and_longest(x, np.array(y), data["lines"][x.shape[1]], blur, reach)
        now = shown(page)
        for name, (shift, lengths) in right.items():
            rel, near = (1e-5, 1e-3) if name == "Sinkhorn" else (1e-9, 1e-8)
            assert now[f"{name}Shift"] == pytest.approx(shift, rel=rel, abs=near), name
            assert now[f"{name}Longest"] == pytest.approx(lengths.max(), rel=10 * rel, abs=near), name
            assert now[f"{name}Moved"] == (lengths > 1).sum(), name
        return right

    target = np.array(data["scenes"]["aside"]["target"])
    whole = agrees("aside", target)
    page.get_by_role("slider", name="blur").fill("20")
    agrees("aside", target, blur=20)
    page.get_by_role("slider", name="blur").fill("10")
    page.get_by_role("slider", name="reach").fill("10")
    assert agrees("aside", target, reach=10)["exact"][0] < whole["exact"][0]
    assert "within 10 mm only" in status(page)
    page.get_by_role("slider", name="reach").fill("150")
    points = page.get_by_role("slider", name="target points, under sliced")
    points.focus()
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Shift+ArrowUp")
    moved = target.copy()
    moved[0] = np.clip(moved[0] + [20, 20], -48, [126, 48])
    np.testing.assert_allclose(page.locator(".live-figure").evaluate("node => node.state.target"), moved)
    agrees("aside", moved)
    # Flipped normals: 20 units each for a quarter of the mass.
    page.get_by_role("radio", name="flips").check()
    assert page.get_by_role("checkbox", name="compare normals").is_checked()
    right = agrees("flips", data["scenes"]["flips"]["target"], normals=True)
    assert right["exact"][0] == pytest.approx(10)
    assert right["exact"][1].max() == 0
    page.get_by_role("button", name="flip the normal").click()
    assert shown(page)["exactShift"] == pytest.approx(math.sqrt(5 / 24) * 20)
    page.get_by_role("checkbox", name="compare normals").uncheck()
    assert shown(page)["exactShift"] == 0


def drawn_sample(fault, n, seed, spacing):
    """One sample of the figure on power, from the same uniform numbers."""
    data, u = DATA["detection"], mulberry(seed, 500)
    tail = {"a tenth far away": n // 10, "one outlier": 1}.get(fault, 0)
    used, n = (1 if spacing == "even" else n - tail), n - tail
    share = (np.arange(n) + u[0]) / n if spacing == "even" else np.array(u[:n])
    turn = share
    if fault == "crowded 3 : 1":
        turn = np.where(share < 0.75, -0.25 + share / 0.75 / 2, 0.25 + (share - 0.75) / 0.25 / 2)
    if fault == "a quarter missing":
        turn = share * 0.75
    points = 40 * np.stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)], axis=1)
    if fault == "a tenth far away":
        pairs = np.array(u[used : used + 4 * tail]).reshape(-1, 2)
        drawn = np.sqrt(-2 * np.log1p(-pairs[:, 0])) * np.cos(2 * np.pi * pairs[:, 1])
        points = np.vstack([points, [100, 0] + 4 * drawn.reshape(-1, 2)])
    if fault == "one outlier":
        points = np.vstack([points, [120, 0]])
    if fault == "bump of 6 mm":
        ends = np.vstack([data["bump"], data["bump"][:1]])
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1))])
        points = np.stack([np.interp(share * along[-1], along, ends[:, k]) for k in (0, 1)], axis=1)
    if fault == "moved by 3 mm":
        points = points + np.array([3, 0])
    if "flipped" in fault or fault == "(normals)":
        points = points_and_normals(points, (turn < 0.25) & (fault != "(normals)"))
    return points


def values_of_pairs(fault, n, spacing, count):
    """Equivalent shifts of three losses for pairs without and with a fault."""
    without = "(normals)" if "flipped" in fault else "(no fault)"
    found = []
    for k in range(count):
        first = drawn_sample(without, n, 2 * k, spacing)
        for second in (drawn_sample(without, n, 2 * k + 1, spacing), drawn_sample(fault, n, 2 * k + 1, spacing)):
            d = first.shape[1]
            sliced = meshot.sliced_wasserstein(
                first, second, torch.tensor(DATA["detection"]["lines"][d], dtype=torch.float64)
            )
            costs = meshot.chamfer(first, second) / 2, meshot.wasserstein(first, second), d * sliced
            found.append([math.sqrt(float(cost)) for cost in costs])
    return np.array(found).reshape(count, 2, 3)


@pytest.mark.parametrize("spacing", ["random", "even"])
def test_power_is_that_of_the_same_samples_in_python(spacing, opened):
    page, data = opened("detection", 400), DATA["detection"]
    page.get_by_role("radio", name=spacing).check()
    for fault in data["powers"]:
        page.get_by_role("radio", name=fault).check()
        page.evaluate("() => { for (let k = 0; k < 60; k += 1) document.querySelector('.once').click(); }")
        assert shown(page)["pairs"] == 48
        values = values_of_pairs(fault, 30, spacing, 48)
        limits = np.quantile(values[:, 0], 0.95, axis=0)
        for k, name in enumerate(("Chamfer", "exact", "sliced")):
            assert shown(page)[f"{name}Floor"] == pytest.approx(values[:, 0, k].mean(), rel=1e-9)
            assert shown(page)[f"{name}Limit"] == pytest.approx(limits[k], rel=1e-9)
            assert shown(page)[f"{name}Power"] == np.mean(values[:, 1, k] > limits[k])
        assert ("table 0.25" in status(page)) is (spacing == "random")
    limits = []
    for _ in range(3):
        page.get_by_role("button", name="other samples").click()
        limits.append(shown(page)["exactLimit"])
    assert len(set(limits)) == 3


def tent_in_python(corners, angle, n, seed):
    """Law of a triangle in the plane, and distances of n² samples and of n² barycentres to it."""
    flat = torch.tensor([[*corner, 0] for corner in corners], dtype=torch.float64)
    triangle = meshot.Mesh(flat, torch.tensor([[0, 1, 2]]))
    radians = math.radians(angle)
    axis = torch.tensor([math.cos(radians), math.sin(radians), 0], dtype=torch.float64)
    shares = np.array(mulberry(seed, 2 * n * n)).reshape(-1, 2)
    shares = np.where(shares.sum(axis=1, keepdims=True) > 1, 1 - shares, shares)
    drawn = flat[0] + torch.tensor(shares) @ (flat[1:] - flat[0])
    parts = flat, triangle.faces
    for _ in range(int(math.log2(n))):
        parts = split_in_four(*parts)
    clouds = {"samples": drawn, "barycentres": parts[0][parts[1]].mean(dim=1)}
    measure = meshot.surface(triangle)
    costs = {
        name: float(meshot.sliced_wasserstein(meshot.DiscreteMeasure(points), measure, axis[None]))
        for name, points in clouds.items()
    }
    return projected_law(measure, axis), {name: math.sqrt(cost) for name, cost in costs.items()}


def test_the_tent_is_the_law_of_the_library(opened):
    page = opened("tent")

    def agrees(n=2, seed=0):
        corners, angle = page.locator(".live-figure").evaluate("node => [node.state.corners, node.state.angle]")
        law, own = tent_in_python(corners, angle, n, seed)
        now = shown(page)
        assert [now["low"], now["high"]] == pytest.approx([law.starts[0], law.starts[-1] + law.extents[-1]], abs=1e-12)
        assert now["peak"] == pytest.approx(law.density(np.array([now["middle"]]))[0], rel=1e-9)
        for name, value in own.items():
            assert now[name] == pytest.approx(value, rel=1e-9)
        return now

    before = agrees()
    for n, seed in ((1, 0), (8, 0), (4, 1)):
        page.get_by_role("slider", name="samples and parts").fill(str(n))
        if seed:
            page.get_by_role("button", name="other samples").click()
        now = agrees(n, seed)
        if n == 1:  # the standard deviation of a tent, in closed form
            p = np.array([now["low"], now["middle"], now["high"]])
            assert now["barycentres"] ** 2 == pytest.approx((p @ p - p[0] * p[1] - p[1] * p[2] - p[2] * p[0]) / 18)
    # A corner moves at a right angle to the line: the tent stays.
    page.get_by_role("slider", name="angle", exact=True).fill("0")
    first = shown(page)
    corners = page.get_by_role("slider", name="corners")
    corners.focus()
    page.keyboard.press("Shift+ArrowDown")
    assert agrees(4, 1)["peak"] == first["peak"]
    page.keyboard.press("Shift+ArrowLeft")
    assert agrees(4, 1)["peak"] < first["peak"]
    assert before["peak"] != first["peak"]
    # It cannot be made flat.
    page.keyboard.press("PageDown")
    for key in ("ArrowLeft", "ArrowDown"):
        for _ in range(40):
            page.keyboard.press(key)
            page.keyboard.press("Shift+" + key)
    assert shown(page)["peak"] > 0
    agrees(4, 1)


def sheets(gap, apart):
    """Two parallel squares of 128 triangles, with normals that point away from each other or towards each other."""
    side = torch.tensor([[0.0, 0, 0], [0, 20, 0], [0, 20, 20], [0, 0, 20]], dtype=torch.float64)
    places, faces = side, torch.tensor([[0, 1, 2], [0, 2, 3]])
    for _ in range(3):
        places, faces = split_in_four(places, faces)
    other = places + torch.tensor([gap, 0.0, 0.0], dtype=torch.float64)
    both = torch.cat([faces.flip(1), faces + len(places)])
    return meshot.Mesh(torch.cat([places, other]), both if apart else both.flip(1))


def test_normals_move_the_blade_as_the_library_says(opened):
    page = opened("normals")
    lines = torch.tensor(
        page.evaluate(f"() => {{ {joined(f'{ASSETS}/frames.js')} return orthogonalDirections(60, 6, generator(1)); }}"),
        dtype=torch.float64,
    )
    for gap, power in ((2, -0.5), (2, 0), (2, 0.3), (4, 0.3), (1, 1)):
        page.get_by_role("radio", name=f"{gap} mm").check()
        page.get_by_role("slider", name="length of a normal").fill(str(power))
        s, (blade, slit) = 10**power, (sheets(gap, apart) for apart in (True, False))
        places = meshot.varifold(blade, normal_scale=s).points.clone().requires_grad_()
        target = meshot.varifold(slit, normal_scale=s)
        cost = 6 * meshot.sliced_wasserstein(meshot.DiscreteMeasure(places), target, lines)
        (gradient,) = torch.autograd.grad(cost, places)
        now = shown(page)
        assert now["length"] == pytest.approx(s)
        assert now["sliced"] == pytest.approx(cost.item(), rel=1e-9)
        back = -gradient[places.detach()[:, 0] < gap / 2, 0].sum().item()
        assert now["slicedShare"] == pytest.approx(back / gap, rel=1e-9)
        assert now["exact"] == pytest.approx(min(4 * s**2, gap**2))
        if 2 * s == gap:
            assert "undecided" in status(page)
        else:
            assert now["exactShare"] == pytest.approx(float(2 * s > gap), abs=1e-12)


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


def test_the_power_is_that_of_python(opened):
    page = opened("power")
    reliability, pilot, effect = 0.6, 12, 0.8
    for people, scans, pilot, effect in ((23, 1, 12, 0.8), (42, 1, 12, 0.8), (42, 3, 40, 0.8), (7, 6, 6, 1.3)):
        values = {"effect": effect, "people in each group": people, "scans of each person": scans}
        for name, value in (values | {"people who gave σ": pilot}).items():
            page.get_by_role("slider", name=name, exact=True).fill(str(value))
        of_mean = scans * reliability / (1 + (scans - 1) * reliability)  # Spearman and Brown
        factors = (pilot - 2) / stats.chi2.ppf([0.975, 0.025], pilot - 2)
        now = shown(page)
        assert now["reliability"] == pytest.approx(reliability, rel=1e-9)
        assert now["power"] == pytest.approx(power_of_groups(effect * of_mean**0.5, people), rel=1e-9)
        assert now["needed"] == people_needed(effect, of_mean)
        assert [now["low"], now["high"]] == [people_needed(effect / f**0.5, of_mean) for f in factors]
    page.get_by_role("radio", name="volume (ml)").check()
    assert shown(page)["needed"] == people_needed(0.8, 50**2 / (50**2 + 4**2), 0.8)
    assert "40 ml" in page.locator(".own").text_content()


def test_the_tables_are_in_order_and_pairs_are_counted(opened):
    page = opened("tables")
    for column, budget, initial in itertools.product(("one", "two"), ("steps", "seconds"), (True, False)):
        page.get_by_role("radio", name=column).check()
        page.get_by_role("radio", name=budget).check()
        page.get_by_role("checkbox").set_checked(initial)
        rows = [row for row in DATA["tables"]["rows"] if (row["column"], row["budget"]) == (column, budget)]
        rows = [row for row in rows if row["system"] in ("A", "B", "C", "D", "start")[: 5 if initial else 4]]
        for order, shown_key in itertools.product(DATA["tables"]["measures"], repeat=2):
            for number, key in enumerate((order, shown_key)):
                page.get_by_role("radio", name=key, exact=True).nth(number).check()
            signs = {"normals": -1}
            ranks = {key: [signs.get(key, 1) * row[key][0] for row in rows] for key in (order, shown_key)}
            first = rows[int(np.argmin(ranks[shown_key]))] if shown_key != "crossing" else None
            now = shown(page)
            if first:
                assert page.locator(".live-figure").get_attribute("data-first") == first["system"]
                apart = [abs(row[shown_key][0] - first[shown_key][0]) for row in rows]
                assert now["overlap"] == sum(gap <= 2 * first[shown_key][1] for gap in apart) - 1
            assert now["mean"] == pytest.approx(min(ranks[shown_key]) * signs.get(shown_key, 1), rel=1e-12)
            a, b = (np.array(ranks[key]) for key in (order, shown_key))
            turned = (np.sign(a[:, None] - a) * np.sign(b[:, None] - b) < 0).sum() / 2
            if order != "crossing":  # equal values have no order
                assert now["turned"] == turned


def test_thickness_between_two_curves_is_that_of_many_points(opened):
    page, length = opened("thickness"), DATA["thickness"]["length"]
    names = ("slide of the pial points", "depth of the folds", "length of a fold", "gap between the curves", "look at")
    for slide, depth, wave, gap, place in (
        (0, 5, 16, 2.5, 16),
        (2, 5, 16, 2.5, 20.5),
        (-3.5, 8, 11, 4, 7),
        (1, 0, 20, 3, 9),
    ):
        for name, value in zip(names, (slide, depth, wave, gap, place), strict=True):
            page.get_by_role("slider", name=name, exact=True).fill(str(value))
        x = np.linspace(-length / 2, 3 * length / 2, 40_001)
        heights = depth * np.cos(2 * np.pi * x / wave), 0.7 * depth * np.cos(2 * np.pi * x / wave) + gap
        curves = [np.stack([x, height], axis=1) for height in heights]

        def at(position, slid, curve, x=x, heights=heights):
            return np.array([position + slid, np.interp(position + slid, x, heights[curve])])

        def definitions(position, slide=slide, curves=curves, at=at):
            w, p = at(position, 0, 0), at(position, slide, 1)
            ways = [np.linalg.norm(curve - point, axis=1).min() for curve, point in ((curves[1], w), (curves[0], p))]
            return np.linalg.norm(w - p), *ways

        now, (pair, there, back) = shown(page), definitions(place)
        assert now["pair"] == pytest.approx(pair, abs=1e-3)
        assert [now["there"], now["back"]] == pytest.approx([there, back], abs=5e-3)
        assert now["both"] == pytest.approx((there + back) / 2, abs=5e-3)
        every = np.array([definitions(position) for position in np.linspace(0, length, 97)])
        assert now["meanPair"] == pytest.approx(every[:, 0].mean(), abs=0.03)
        assert now["meanBoth"] == pytest.approx(every[:, 1:].mean(), abs=0.03)


def test_missing_area_moves_the_mass_of_the_whole_brain(opened):
    page, data = opened("missing"), DATA["missing"]
    slab, n_pieces = data["slab"], 50
    pieces = data["low"] + slab * (np.arange(len(data["areas"]) * n_pieces) + 0.5) / n_pieces
    whole = np.repeat(np.array(data["areas"]) / n_pieces, n_pieces)
    for missing, width, middle, place in ((5, 40, 46, 0), (10, 12, -21, -30), (2.5, 60, 10, 14), (0, 20, 0, 0)):
        sliders = {"missing in the region": missing, "width of the region": width, "middle of the region": middle}
        for name, value in (sliders | {"look at": place}).items():
            page.get_by_role("slider", name=name, exact=True).fill(str(value))
        middle = float(page.get_by_role("slider", name="middle of the region", exact=True).input_value())
        left = whole * np.where(np.abs(pieces - middle) < width / 2, 1 - missing / 100, 1)
        now = shown(page)
        assert now["share"] == pytest.approx(1 - left.sum() / whole.sum(), abs=1e-9)
        masses = left / left.sum(), whole / whole.sum()
        plan = ot.emd_1d(pieces, pieces, *masses, metric="euclidean", dense=False).tocoo()
        ways = plan.data * (pieces[plan.col] - pieces[plan.row])
        moved = np.bincount(plan.row, ways, len(pieces)) / masses[0]
        assert now["mean"] == pytest.approx(ways.sum(), abs=1e-6)
        near = np.abs(pieces - place) < 0.03
        assert now["here"] == pytest.approx(moved[near].mean(), abs=0.03)
        assert abs(now["largest"]) == pytest.approx(np.abs(moved).max(), abs=0.06)
        centres = pieces.reshape(-1, n_pieces).mean(axis=1)
        seen = np.exp(-0.5 * ((centres - place) / data["reach"]) ** 2)
        means = [np.average(centres, weights=seen * mass.reshape(-1, n_pieces).sum(axis=1)) for mass in (whole, left)]
        assert now["within"] == pytest.approx(means[0] - means[1], abs=1e-9)


def test_the_best_of_equal_losses_looks_better_by_what_is_expected(opened):
    page = opened("luck")
    draws = np.random.default_rng(0).normal(size=(200_000, 30))
    for count, between, seeds, subject, subjects in ((6, 0.0065, 1, 0, 4), (30, 0.01, 4, 0.02, 16), (2, 0, 1, 0.03, 9)):
        values = {"losses": count, "deviation between seeds": between, "seeds of each": seeds}
        for name, value in (values | {"deviation of a subject": subject}).items():
            page.get_by_role("slider", name=name, exact=True).fill(str(value))
        if subject:
            page.get_by_role("slider", name="subjects", exact=True).fill(str(subjects))
        page.evaluate("() => { for (let k = 0; k < 600; k += 1) document.querySelector('.once').click(); }")
        deviation = math.hypot(between / seeds**0.5, subject / subjects**0.5)
        now = shown(page)
        assert now["studies"] == 620
        best = draws[:, :count].max(axis=1)
        assert now["expected"] == pytest.approx(deviation * best.mean(), rel=0.01)
        assert now["chance"] == pytest.approx((deviation * (best - draws[:, 0]) > 0.017).mean(), abs=0.005)
        assert now["mean"] == pytest.approx(now["expected"], abs=4 * now["error"])
        assert now["error"] < 0.04 * deviation
        assert abs(now["again"]) < 4 * deviation / 620**0.5


def test_the_order_at_a_budget_is_that_of_the_courses(opened):
    page = opened("budget")
    seen = set()
    for group, budget, kept in itertools.product(("readings", "controls"), (1.75, 1.9, 2.6, 3.7), ("last", "best")):
        page.get_by_role("radio", name=group).check()
        page.get_by_role("radio", name=f"of the {kept} check").check()
        page.get_by_role("slider", name="budget").fill(str(budget))
        values, ended = {}, 0
        for course in DATA["budget"]["courses"]:
            checks = [value for step, value in zip(course["step"], course["assd"]) if step <= round(10**budget)]
            if course["group"] == group and checks:
                values[course["name"]] = min(checks) if kept == "best" else checks[-1]
                ended += len(checks) == len(course["assd"]) and course["step"][-1] < round(10**budget)
        order = page.locator(".live-figure").get_attribute("data-order")
        assert order == " | ".join(sorted(values, key=values.get))
        now = shown(page)
        assert now["first"] == (min(values.values()) if values else -1)
        assert now["nearer"] == sum(value < 0.4 for value in values.values())
        assert now["ended"] == ended
        seen |= {len(values), -ended}
    assert {0, 3, 9, -3} <= seen


def test_a_thin_gyrus_on_a_grid_is_whole_in_the_share_of_positions_that_the_ratio_gives(opened):
    page = opened("layers")
    tried = shown(page)["tried"]
    for width in (0.6, 1.05):
        page.get_by_role("slider", name="thickness of the gyrus").fill(str(width))
        share = width / 1.5
        assert shown(page)["whole"] == pytest.approx(share, abs=3.5 * math.sqrt(share * (1 - share) / tried))
        assert shown(page)["whole"] + shown(page)["gone"] == pytest.approx(1)
    page.get_by_role("slider", name="turned by").fill("5")
    assert (shown(page)["whole"], shown(page)["broken"]) == (0, 1)
    for angle in (0, 20, 45):
        page.get_by_role("slider", name="turned by").fill(str(angle))
        page.get_by_role("slider", name="thickness of the gyrus").fill("1.5")
        assert shown(page)["whole"] == 1
    # The curves of the position that is drawn are those of scikit-image.
    counts = set()
    for width, angle, across in itertools.product((0.6, 1.05), (0, 5, 30), (0.1, 0.55)):
        page.get_by_role("slider", name="thickness of the gyrus").fill(str(width))
        page.get_by_role("slider", name="turned by").fill(str(angle))
        page.get_by_role("slider", name="shift of the grid").fill(str(across))
        right = len(find_contours(strip_distances(width, 1.5, np.radians(angle), across, 0.5), 0))
        assert shown(page)["curves"] == right
        counts.add(right)
    assert len(counts) > 2


def strip_distances(width, spacing, angle, across, along, length=16):
    """Signed distances from a strip with round ends at the positions of a grid, one row for each height."""
    n = 2 * math.ceil((length / 2 + 3) / spacing) + 2
    x, y = np.meshgrid(*((np.arange(n) - n / 2 + shift) * spacing for shift in (along, across)), indexing="ij")
    u, v = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
    return np.hypot(np.maximum(0, np.abs(u) - (length - width) / 2), v) - width / 2


def test_slices_show_the_numbers_of_the_library(opened):
    page, slices = opened("slices"), DATA["slices"]["slices"]
    for k, position in enumerate(("−12", "0.1")):
        page.get_by_role("slider", name="slice", exact=True).fill(str(k))
        for limit in (0.5, 1, 2, 3):
            page.get_by_role("slider", name="limit").fill(str(limit))
            wanted = live_numbers(slices, limit)[k]
            for name, value in wanted.items():
                assert shown(page)[name] == pytest.approx(value, rel=1e-9), name
            assert f"Slice y = {position} mm" in status(page)
            assert f"{wanted['length']:.0f} mm of our line" in status(page)
    assert live_numbers(slices, 0.5)[0]["mean"] < -0.5
    assert "inside FreeSurfer's surface" in status(page)
    # The picture is that of the slice, and lies where its extent says.
    picture = page.locator(".plots image")
    assert picture.count() == 1
    assert picture.get_attribute("href").endswith(slices[1]["picture"])
    # Lines of one surface, or of both.
    counts = {}
    for lines in ("both", "ours", "FreeSurfer's"):
        page.get_by_role("radio", name=lines).check()
        counts[lines] = page.locator(".plots svg").first.locator("path").count()
    assert counts["both"] > max(counts["ours"], counts["FreeSurfer's"])


def normals_of(numbers):
    """Standard normal numbers from pairs of uniform ones."""
    u = np.array(numbers).reshape(-1, 2)
    return np.sqrt(-2 * np.log1p(-u[:, 0])) * np.cos(2 * np.pi * u[:, 1])


def unit_vectors(numbers):
    vectors = normals_of(numbers).reshape(-1, 3)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("centred", [False, True])
def test_the_error_of_spheres_apart_is_that_of_the_same_samples_in_python(centred, opened):
    page, data = opened("apart"), DATA["apart"]
    lines = torch.tensor(unit_vectors(mulberry(1, 6 * data["lines"])))
    draws = np.array(unit_vectors(mulberry(data["seed"], 4 * 2 * 1000 * 6))).reshape(4, 2, 1000, 3)
    if centred:
        page.get_by_role("checkbox").check()
    for apart, m in ((100, 1000), (10, 30), (1000, 300)):
        page.get_by_role("radio", name=f"{apart} mm", exact=True).check()
        page.get_by_role("radio", name=f"{m}", exact=True).check()
        assert shown(page)["rounds"] == 4
        for p in (1, 2, 3):
            found = []
            for x, y in draws[:, :, :m]:
                source, target = 40 * x, 38 * y + np.array([apart, 0, 0])
                if centred:
                    source, target = source - source.mean(axis=0), target - target.mean(axis=0)
                # Quantile functions of uniform distributions, at the middles of very many equal shares.
                z = (np.arange(200_000) + 0.5) / 100_000 - 1
                c = (0 if centred else apart) * lines[:, 0].numpy()
                truth = np.mean([(np.abs(-2 * z + each) ** p).mean() for each in c])
                found.append(abs(float(meshot.sliced_wasserstein(source, target, lines, p)) - truth))
            assert shown(page)[f"error{p}"] == pytest.approx(np.mean(found), rel=1e-6)
    page.evaluate("() => { for (let k = 0; k < 40; k += 1) document.querySelector('.once').click(); }")
    for p in (1, 2, 3):
        assert shown(page)[f"far{p}"] == pytest.approx(0 if centred else p - 1, abs=0.03)
        assert centred or shown(page)[f"many{p}"] == pytest.approx(-0.5, abs=0.15)
    page.get_by_role("radio", name="divided").check()
    assert shown(page)["far2"] == pytest.approx(0 if centred else -1, abs=0.05)


def test_whole_blocks_have_no_error_for_a_translation(opened):
    page = opened("blocks")
    assert shown(page)["orthogonal"] < 1e-12
    assert "all blocks are whole" in status(page)
    page.get_by_role("slider", name="directions").fill("10")
    assert shown(page)["orthogonal"] > 0.01
    # The same sets in Python, against the closed form for a translation and a stretch.
    page.get_by_role("slider", name="stretch").fill("2")
    assert shown(page)["rounds"] == 20
    level = np.linspace(0, 1, 1_000_001)
    shape = (np.sqrt(1 + 3 * level**2) - 1) ** 2
    truth = 4 / 3 + np.trapezoid(shape, level)
    assert shown(page)["truth"] == pytest.approx(truth, rel=1e-8)
    for known in (False, True):
        page.get_by_role("checkbox").set_checked(known)
        found = []
        for k in range(20):
            u = unit_vectors(mulberry(k, 60))[:, 0]
            found.append(((4 / 3 if known else 4 * u**2) + (np.sqrt(1 + 3 * u**2) - 1) ** 2).mean() / truth - 1)
        assert shown(page)["random"] == pytest.approx(np.sqrt(np.mean(np.square(found))), rel=1e-7)
    # Two equal distributions cannot be chosen.
    page.get_by_role("slider", name="stretch").fill("1")
    page.get_by_role("slider", name="distance").fill("0")
    assert page.locator(".live-figure").evaluate("node => node.state.stretch") == 1.1
    page.get_by_role("slider", name="directions").fill("300")
    now = shown(page)
    assert now["spiral"] < now["orthogonal"] < now["random"]


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


def unit(degrees):
    radians = np.radians(degrees)
    return np.stack([np.cos(radians), np.sin(radians)], axis=-1)


def ghost_pair(directions):
    """The solution of the exercise in chapter 3."""
    first, second = np.zeros((1, 2)), np.zeros((0, 2))
    for x, y in directions:
        across = np.array([-y, x])
        first, second = np.vstack([first, second + across]), np.vstack([second, first + across])
    return first, second


def test_ghost_pairs_agree_along_the_chosen_directions_and_no_other(opened):
    page, angles = opened("ghost"), list(DATA["ghost"]["angles"])

    def agrees(pair, chosen, probe):
        now = shown(page)
        assert now["points"] == len(pair[0])
        assert meshot.slice_costs(*pair, unit(np.array(chosen))).numpy().max() < 1e-12
        assert now["own"] < 1e-12
        assert now["cost"] == pytest.approx(meshot.slice_costs(*pair, unit(np.array([probe]))).item(), rel=1e-9)
        mean = meshot.slice_costs(*pair, unit(np.arange(180))).mean().item()
        assert now["sliced"] == pytest.approx(math.sqrt(mean), rel=1e-9)
        assert now["exact"] == pytest.approx(math.sqrt(float(meshot.wasserstein(*pair))), rel=1e-9)
        assert f"equal projections along {len(chosen)} directions" in status(page)

    line = page.get_by_role("slider", name="line", exact=True)
    for count in (4, 7):
        page.get_by_role("slider", name="chosen directions").last.fill(str(count))
        corners = 2 * unit(180 / count * np.arange(2 * count))
        agrees((corners[::2], corners[1::2]), 180 / count * (np.arange(count) + 0.5), 40)
    line.fill("91")
    agrees((corners[::2], corners[1::2]), 180 / count * (np.arange(count) + 0.5), 91)
    page.get_by_role("radio", name="by doubling").check()
    agrees(ghost_pair(unit(np.array(angles))), angles, 91)
    assert shown(page)["points"] == 64
    page.get_by_role("slider", name="chosen directions").last.fill("3")
    hand = page.get_by_role("slider", name="chosen directions").first
    hand.focus()
    page.keyboard.press("PageDown")
    page.keyboard.press("ArrowLeft")
    angles[1] += 1
    agrees(ghost_pair(unit(np.array(angles[:3]))), angles[:3], 91)
    line.fill(str(angles[1]))
    assert shown(page)["cost"] < 1e-12
    assert f"Cost at {angles[1]}°: 0." in status(page)


def entropic_cost(x, y, blur):
    """The minimum of ⟨C, π⟩ + ε KL, by POT."""
    a, b, epsilon = np.full(len(x), 1 / len(x)), np.full(len(y), 1 / len(y)), 2 * blur**2
    costs = ot.dist(x, y)
    plan = ot.sinkhorn(a, b, costs, epsilon, method="sinkhorn_log", stopThr=1e-13, numItermax=20000)
    return (plan * costs).sum() + epsilon * (plan * np.log(plan / np.outer(a, b))).sum()


def divergence(x, y, blur):
    return entropic_cost(x, y, blur) - (entropic_cost(x, x, blur) + entropic_cost(y, y, blur)) / 2


def test_the_blur_has_the_costs_of_pot_and_the_arrows_are_their_gradients(opened):
    page = opened("blur")
    x, y = (np.array(DATA["blur"][key]) for key in ("points", "target"))
    for logarithm, debiased in itertools.product((1.1, 1.5, 2.3), (False, True)):
        page.get_by_role("slider", name="blur", exact=True).fill(str(logarithm))
        page.get_by_role("checkbox").set_checked(debiased)
        now, blur = shown(page), 10**logarithm
        assert now["plain"] == pytest.approx(entropic_cost(x, y, blur), rel=1e-9)
        assert now["divergence"] == pytest.approx(divergence(x, y, blur), rel=1e-8)
        assert now["exact"] == pytest.approx(float(meshot.wasserstein(x, y)), rel=1e-9)
        for key, axis in (("u", 0), ("v", 1)):
            ends = []
            for h in (1e-3, -1e-3):
                moved = x.copy()
                moved[0, axis] += h
                ends.append((divergence if debiased else entropic_cost)(moved, y, blur))
            # The arrow is −n/2 times the gradient.
            assert now[key] == pytest.approx(-len(x) / 2 * (ends[0] - ends[1]) / 2e-3, rel=1e-4, abs=1e-5)


def test_without_debiasing_points_stop_inside_the_target(opened):
    page = opened("blur")
    press = "() => { for (let k = 0; k < 150; k += 1) document.querySelector('.once').click(); }"
    for blur, debiased in ((20, False), (20, True), (30, False), (30, True)):
        page.get_by_role("slider", name="blur", exact=True).fill(f"{math.log10(blur):.2f}")
        page.get_by_role("checkbox").set_checked(debiased)
        page.evaluate(press)
        length = 10 ** round(math.log10(blur), 2)
        # A circle rests on OT_ε where r = R I₁(z) / I₀(z) with z = R r / blur², or in the centre.
        r = 40.0
        for _ in range(2000):
            z = 40 * r / length**2
            r = 40 * ive(1, z) / ive(0, z)
        expected = 40 if debiased else r
        assert shown(page)["size"] == pytest.approx(expected, abs=0.05)
        assert (expected < 1) == (blur == 30 and not debiased)


def test_the_chosen_slices_are_those_of_the_library(opened):
    page = opened("learned")
    x, y, lines = (np.array(DATA["learned"][key]) for key in ("source", "target", "lines"))
    assert shown(page)["loss"] == pytest.approx(float(meshot.sliced_wasserstein(x, y, lines)), rel=1e-9)
    page.get_by_role("radio", name="by energy").check()
    costs = meshot.slice_costs(x, y, lines).numpy()
    for exponent in (0, 3, 5):
        page.get_by_role("slider", name="power α").fill(str(exponent))
        loss = float(energy_sliced_wasserstein(x, y, lines, power=2**exponent))
        assert shown(page)["loss"] == pytest.approx(loss, rel=1e-9)
        raised = costs < 2**exponent / (1 + 2**exponent) * loss
        assert shown(page)["raised"] == pytest.approx(raised.mean())
    page.get_by_role("radio", name="largest cost").check()
    page.get_by_role("slider", name="start of the ascent").fill("20")
    start = np.array([[math.cos(math.radians(20)), math.sin(math.radians(20))]])
    for _ in range(12):
        page.locator(".once").click()
        if "A maximum" in status(page):
            break
    assert "A maximum" in status(page)
    best = max_sliced_direction(x, y, start, n_steps=60)
    found = shown(page)
    assert found["loss"] == pytest.approx(float(meshot.slice_costs(x, y, best[None])[0]), rel=1e-8)
    assert found["angle"] == pytest.approx(math.degrees(math.atan2(best[1], best[0])) % 180, abs=1e-3)
    # A full step along the arrows: zero along the direction, and unchanged at a right angle.
    page.get_by_role("button", name="move along the arrows").click()
    assert shown(page)["loss"] == pytest.approx(0, abs=1e-12)
    assert shown(page)["beside"] == pytest.approx(found["beside"], rel=1e-9)


def test_the_course_of_a_training_is_that_of_its_log(opened):
    page = opened("ablation")
    for training, step, measure in itertools.product(
        DATA["ablation"]["trainings"], (56, 280, 588, 840), ("ASSD", "normals")
    ):
        page.get_by_role("radio", name=training["name"]).check()
        page.get_by_role("radio", name=measure).check()
        page.get_by_role("slider", name="step", exact=True).fill(str(step))
        until = np.array(training["loss"])[: step // 28]
        assert shown(page)["ratio"] == pytest.approx(until[-11:].mean() / until[0], rel=1e-12)
        checks = [check[measure] for check in training["checks"] if check["step"] <= step]
        assert shown(page)["value"] == (checks[-1] if checks else -1)
        assert ("not checked yet" in status(page)) is (not checks)
        assert ("initial surface: 0.4 mm" in status(page)) is (measure == "ASSD")


def test_below_one_sorting_is_not_the_cheapest_pairing(opened):
    page = opened("concave")
    power = page.get_by_role("slider", name="p", exact=True)

    def costs(x, y, p):
        matrix = np.abs(np.sort(x)[:, None] - np.sort(y)) ** p
        rows, columns = linear_sum_assignment(matrix)
        return matrix[rows, columns].mean(), matrix.diagonal().mean()

    assert shown(page)["crossing"] == 0
    power.fill("0.5")
    assert shown(page)["crossing"] == 1
    assert (shown(page)["best"], shown(page)["sorted"]) == pytest.approx(costs([2, 3.5], [6, 8], 0.5), rel=1e-12)
    page.get_by_role("button", name="six points").click()
    more = DATA["concave"]["more"]
    for p in (0.1, 0.5, 0.95, 1, 1.5, 2):
        power.fill(str(p))
        right = costs(more["source"], more["target"], p)
        assert (shown(page)["best"], shown(page)["sorted"]) == pytest.approx(right, rel=1e-12)
        assert (shown(page)["crossing"] > 0) == (right[0] < right[1] - 1e-9)
        assert ("No pairing is cheaper" in status(page)) == (p >= 1)
