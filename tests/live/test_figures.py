"""Every live figure in a browser without a network: it opens, answers each control, and moves only when asked."""

import gzip
import itertools
import math
import re
from importlib import resources

import numpy as np
import ot
import pytest
import torch
from live_pages import ANSWERS, DATA, live_page_of

import meshot
from browser import AXE, SET_THEME, UNREACHED, page_file, set_width, watched_page
from meshot.mesh import circle, even_points
from meshot.view.page import joined
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


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
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


@pytest.mark.parametrize("name", DATA)
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


@pytest.mark.parametrize("name", DATA)
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
