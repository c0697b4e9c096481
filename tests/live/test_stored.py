"""The notebooks show every live figure, as its script is today."""

import json
import re
from urllib.parse import quote

import nbformat

from browser import watched_page
from meshot.view.page import joined
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
    """What chapters 30 to 33 call right is what their figures show, with the data that they have in the book."""
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
    planted = {"metric": "HD 100 %", "show": "at once"}
    assert values("planted", **planted)["above"] == 0
    assert values("planted", **planted, count=20_000)["value"] > 5
    assert [values("floors", size=size)["above"] for size in (4.3, 5)] == [0, 2]
    assert values("floors", metric="ASSD")["above"] == 8
