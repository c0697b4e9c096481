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
from test_numbers import mulberry

import meshot
from browser import AXE, UNREACHED, page_file, set_width, watched_page
from meshot.loss.exact import projected_law
from meshot.mesh import circle, even_points, split_in_four
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
    data, u = DATA["power"], mulberry(seed, 500)
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
                first, second, torch.tensor(DATA["power"]["lines"][d], dtype=torch.float64)
            )
            costs = meshot.chamfer(first, second) / 2, meshot.wasserstein(first, second), d * sliced
            found.append([math.sqrt(float(cost)) for cost in costs])
    return np.array(found).reshape(count, 2, 3)


@pytest.mark.parametrize("spacing", ["random", "even"])
def test_power_is_that_of_the_same_samples_in_python(spacing, opened):
    page, data = opened("power", 400), DATA["power"]
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
