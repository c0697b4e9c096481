"""The notebooks show every live figure, as its script is today."""

import json
import math
import re
from urllib.parse import quote

import nbformat
import pytest

import meshot
from browser import watched_page
from meshot.mesh import circle, even_points, star
from meshot.view.page import joined
from meshot_book.examples import crossing_sides
from meshot_book.figures.flows import FIELDS, outlines, two_triangles
from meshot_book.flows import descend
from meshot_book.live.figure import figure_names


def stored_figures(folder):
    """Chapter, name and page of each live figure in the stored notebooks."""
    for file in sorted(folder.glob("[0-9]*.ipynb")):
        for cell in nbformat.read(file, as_version=4).cells:
            for output in cell.get("outputs", []):
                page = output.get("data", {}).get("text/html", "")
                found = re.search(r'data-figure="(\w+)"', page)
                if found:
                    yield file.stem, found[1], page


def test_notebooks_hold_every_figure_as_it_is_today(root):
    seen = set()
    for chapter, name, page in stored_figures(root / "notebooks"):
        script = joined("meshot/view/assets/wake.js", f"meshot_book/live/figures/assets/{name}.js")
        assert script in page, f"{chapter} shows an older {name}: make notebooks NAME={chapter}"
        seen.add(name)
    assert sorted(seen) == figure_names()


def test_the_answers_of_the_questions_hold_in_the_book(root, tmp_path, context):
    """What chapters 16 to 20 call right is what their figures show, with the data that they have in the book."""
    found = {name: page for _, name, page in stored_figures(root / "notebooks")}

    def values(name, **state):
        address = f"#{name}={quote(json.dumps(state))}"
        file = tmp_path / "page.html"
        file.write_text(f"<!doctype html><meta charset=utf-8><body>{found[name]}</body>", encoding="utf-8")
        with watched_page(context, file) as (page, troubles):
            page.goto(page.url + address)
            page.reload()
            shown = page.locator(".live-figure").evaluate("node => Object.assign({}, node.dataset)")
            assert troubles == []
        return {key: float(value) for key, value in shown.items() if re.fullmatch(r"-?[\d.]+(e-?\d+)?", value)}

    imaging = values("imaging")
    assert imaging["bias"] > 1.5 * max(imaging["blur"], imaging["noise"])
    assert max(imaging["blur"], imaging["noise"]) > imaging["plain"]
    assert [values("threshold", threshold=level)["handles"] for level in (35, 40, 60)] == [0, 1, 7]
    assert values("threshold", threshold=35, touch="a face")["handles"] == 9
    assert abs(values("repair", step=1000)["cut"] - 60) < 5
    cubes = values("cubes")
    assert [cubes[f"holds{scale}"] for scale in range(3)] == [0, 1, 1]
    assert max(cubes["range1"], cubes["range2"]) > 2 * cubes["range0"]
    still, slid = values("thickness"), values("thickness", slide=2)
    assert slid["meanPair"] > 1.1 * still["meanPair"]
    assert abs(slid["meanBoth"] / still["meanBoth"] - 1) < 0.1
    missing = values("missing")
    assert missing["here"] > 0.5 > 10 * abs(missing["within"])
    planted = {"metric": "HD 100 %", "show": "at once"}
    assert values("planted", **planted)["above"] == 0
    assert values("planted", **planted, count=20_000)["value"] > 5
    assert [values("floors", size=size)["above"] for size in (4.3, 5)] == [0, 2]
    assert values("floors", metric="ASSD")["above"] == 8


@pytest.fixture
def stored(root, tmp_path, context):
    """Opens the figure that a notebook holds, and at the end has seen no trouble."""
    ends = []

    def open_figure(wanted):
        (page,) = (page for _, name, page in stored_figures(root / "notebooks") if name == wanted)
        file = tmp_path / "page.html"
        file.write_text(f"<!doctype html><meta charset=utf-8><body>{page}</body>", encoding="utf-8")
        watching = watched_page(context, file)
        opened, troubles = watching.__enter__()
        ends.append((watching, troubles))
        return opened

    yield open_figure
    for watching, troubles in ends:
        assert troubles == []
        watching.__exit__(None, None, None)


def test_the_answer_of_chapter_1_is_what_its_figure_shows(stored):
    """Without momentum the points stop at a larger loss, and both losses stand in the text below the figure."""
    page = stored("descent")
    page.get_by_role("button", name="just show me").click()
    few, ring = (even_points(each, 24).double() for each in (star(5, 1.5, 0.35), circle()))
    goal = meshot.DiscreteMeasure(few)
    seen = page.locator(".seen").text_content()
    press = "(steps) => { while (steps--) document.querySelector('.once').click(); }"
    ends = {}
    for momentum in (0, 0.9):
        page.get_by_role("slider", name="momentum").fill(str(momentum))
        page.get_by_role("button", name="start again").click()
        page.evaluate(press, 400)
        ends[momentum] = float(page.locator(".live-figure").get_attribute("data-loss"))
        assert "It has stopped" in page.locator(".status").text_content()
        loss = lambda points: meshot.chamfer(meshot.DiscreteMeasure(points), goal)  # noqa: E731
        assert ends[momentum] == pytest.approx(float(loss(descend(loss, ring, 400, 0.6, momentum).points)), rel=1e-6)
    assert f"{ends[0]:.3f}" in seen
    assert f"{ends[0.9]:.4f}" in seen
    assert right_answer(page) == "no: without momentum they stop at a larger loss"


def test_the_answer_of_chapter_20_is_what_its_figure_shows(stored):
    """The number of crossings under the whirl grows with the first cuts, and ends at zero."""
    page = stored("crossing")
    page.get_by_role("button", name="just show me").click()
    page.get_by_role("radio", name="whirl").check()
    pairs, corners = [], two_triangles(0.3)
    for exponent in range(6):
        page.get_by_role("slider", name="pieces").fill(str(exponent))
        pairs.append(int(page.locator(".live-figure").get_attribute("data-pairs")))
        assert pairs[-1] == crossing_sides(outlines(FIELDS["whirl"], corners, 1.0, 8, 2**exponent))
    assert pairs[1] > pairs[0] > 0
    assert pairs[-1] == 0
    assert right_answer(page) == "it grows at first, and then falls to zero"


def right_answer(page):
    """The answer that the figure calls right."""
    return page.locator("label:has([data-right=yes])").text_content().strip()


def test_the_answers_of_chapters_3_to_14_hold_in_the_book(root, tmp_path, context):
    """What the figures of chapters 3, 4, 7, 10 and 11 call right, and the numbers that their chapters state too."""
    found = {name: page for _, name, page in stored_figures(root / "notebooks")}

    def values(name, steps=0, **state):
        file = tmp_path / "page.html"
        file.write_text(f"<!doctype html><meta charset=utf-8><body>{found[name]}</body>", encoding="utf-8")
        with watched_page(context, file) as (page, troubles):
            page.goto(f"{page.url}#{name}={quote(json.dumps(state))}")
            page.reload()
            page.evaluate("n => { while (n--) document.querySelector('.once').click(); }", steps)
            shown = page.locator(".live-figure").evaluate("node => Object.assign({}, node.dataset)")
            assert troubles == []
        return {key: float(value) for key, value in shown.items() if re.fullmatch(r"-?[\d.]+(e-?\d+)?", value)}

    ghosts = values("ghost")
    assert (ghosts["points"], ghosts["own"] < 1e-12, ghosts["cost"] > 0.01) == (6, True, True)
    seven = values("ghost", count=7)
    assert seven["points"] == 7
    assert seven["sliced"] < ghosts["sliced"]
    assert values("ghost", construction="doubling")["points"] == 32
    scene = values("scene")
    assert [scene[f"{loss}Moved"] for loss in ("Chamfer", "exact", "sliced")] == [1, 1, 21]
    assert 1 < scene["SinkhornMoved"] < values("scene", blur=20)["SinkhornMoved"]
    assert values("scene", reach=90)["exactMoved"] == 1
    assert values("scene", reach=70)["exactMoved"] == 0
    moved = values("detection", 60)
    assert moved["ChamferPower"] > 0.95
    assert max(moved["exactPower"], moved["slicedPower"]) < 0.3
    crowded = values("detection", 60, fault="crowded 3 : 1")
    assert min(crowded["exactPower"], crowded["slicedPower"]) > crowded["ChamferPower"] + 0.2
    assert min(values("detection", 40, spacing="even")[f"{loss}Power"] for loss in ("Chamfer", "exact", "sliced")) == 1
    higher = [[-1.2, -0.6], [1.3, -0.3], [-0.5, 1.9]]
    assert values("tent")["peak"] == values("tent", corners=higher)["peak"]
    apart = values("apart", 40)
    assert [round(apart[f"far{p}"], 1) for p in (1, 2, 3)] == [0, 1, 2]
    assert all(abs(apart[f"many{p}"] + 0.5) < 0.1 for p in (1, 2, 3))
    # The table of chapter 10: 54.4 mm² at 100 mm, from other samples.
    assert abs(apart["error2"] / 54.4 - 1) < 0.2
    assert abs(values("apart", 4, centred=True)["far2"]) < 1e-9
    assert values("blocks")["orthogonal"] < 1e-12 < 0.001 < values("blocks", count=100)["orthogonal"]
    shapes = values("blocks", count=300, stretch=2)
    assert shapes["spiral"] < shapes["orthogonal"] < shapes["random"]
    # The text of chapter 11: 4, 25 and 53 % of the way at a half, twice and five times the gap.
    shares = [values("normals", power=power)["slicedShare"] for power in (0, math.log10(4), 1)]
    # The text has other directions than the 1200 of the figure: three standard errors of a share among so many.
    for share, said in zip(shares, (0.04, 0.25, 0.53), strict=True):
        assert share == pytest.approx(said, abs=3 * math.sqrt(said * (1 - said) / 1200))
    assert [round(values("normals", power=power)["exactShare"]) for power in (-0.01, 0.01)] == [0, 1]
