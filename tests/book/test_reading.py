"""Every page as a reader meets it: whole, within its column at three widths, open to all, and light to load.

Each page is opened once. What is found on the way is what the tests look at.
"""

from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

import build
from browser import barriers, broken_links, raw_tex, sideways, watched_page, weight

#: Pages of the API come from one template: two of them stand for all when axe-core looks.
API_LOOKED_AT = ("meshot.html", "meshot.loss.html")
#: One page of each kind: these are looked at by ``make test``, every page by ``make test-all``.
ONE_OF_EACH = ("index.html", "ledger.html", "07_mesh_as_measure.html", "api/meshot.loss.html")
#: Of a page, as a server sends it, without surfaces to be turned.
HEAVIEST = 1_500_000


class Visit(NamedTuple):
    """What one page was found to be."""

    troubles: list[str]
    sideways: list[str]
    barriers: list[str]
    weight: int


def visit(context, file: Path) -> Visit:
    """Open a page and look at everything."""
    loaded = {file}
    with watched_page(context, file, loaded) as (page, troubles):
        found = troubles + raw_tex(page) + broken_links(page, file)
        files = {path for path in loaded if path.is_file()}
        looked_at = file.parent.name != "api" or file.name in API_LOOKED_AT
        return Visit(found, sideways(page), barriers(page) if looked_at else [], weight(files))


def faults(html, context, names) -> dict[str, Visit]:
    """What is wrong with pages: broken, wider than its column, out of a reader's reach, heavy."""
    visits = {name: visit(context, html / name) for name in names}
    return {name: seen for name, seen in visits.items() if seen[:3] != ([], [], []) or seen.weight > HEAVIEST}


def test_pages_are_whole_without_a_network_fit_are_open_to_all_and_light(html, context):
    assert faults(html, context, ONE_OF_EACH) == {}


@pytest.mark.thorough
def test_every_other_page_is_so_too(html, context):
    names = {file.relative_to(html).as_posix() for file in (*html.glob("*.html"), *html.glob("api/*.html"))}
    chapters = {f"{path.stem}.html" for path in (build.ROOT / "notebooks").glob("[0-9]*.md")}
    assert chapters | {"search.html", "references.html", *(f"api/{name}" for name in API_LOOKED_AT)} <= names
    moved = {f"{name}.html" for name in yaml.safe_load(build.MOVED.read_text(encoding="utf-8"))}
    assert faults(html, context, sorted(names - moved - {*ONE_OF_EACH})) == {}


@pytest.mark.parametrize(
    ("body", "kind", "seen"),
    [
        ('<pre style="overflow: auto">' + "x" * 300 + "</pre>", "sideways", "at 800 px: pre"),
        ('<div style="overflow: hidden"><p style="width: 500px">x</p></div>', "sideways", "at 400 px: div"),
        ('<table><tr><td style="min-width: 900px">x</td></tr></table>', "sideways", "at 800 px: table"),
        ('<img src="data:image/gif;base64,R0lGODlhAQABAAAAACw=">', "barriers", "light: image-alt"),
        ('<p style="color: #777; background: #888">words</p>', "barriers", "light: color-contrast"),
        ('<button tabindex="-1">go</button>', "barriers", "keyboard: <button"),
        ("<span onclick='go()'>go</span>", "barriers", "keyboard: <span"),
        ("<details><summary>more</summary><button></button></details>", "barriers", "light: button-name"),
    ],
)
def test_each_barrier_is_seen(tmp_path, context, body, kind, seen):
    file = tmp_path / "page.html"
    head = '<!doctype html><html lang="en"><title>t</title><style>body { margin: 0 }</style>'
    file.write_text(f"{head}<body><main><article><h1>t</h1>{body}</article></main></body></html>")
    assert any(found.startswith(seen) for found in getattr(visit(context, file), kind))


def test_text_is_weighed_packed(tmp_path):
    text, picture = tmp_path / "a.html", tmp_path / "a.png"
    text.write_text("a" * 10_000)
    picture.write_text("a" * 10_000)
    assert weight({text}) < 100
    assert weight({picture}) == 10_000


def test_nothing_moves_where_a_reader_asks_for_rest(html, context):
    calm = context.browser.new_context(offline=True, reduced_motion="reduce")
    with watched_page(calm, html / "index.html") as (page, _):
        assert page.evaluate("() => getComputedStyle(document.documentElement).scrollBehavior") == "auto"
        page.wait_for_timeout(500)
        assert page.evaluate("() => document.getAnimations().length") == 0
    calm.close()


def test_the_figure_of_the_landing_page_is_live(html, context):
    with watched_page(context, html / "index.html") as (page, troubles):
        figure = page.locator(".shown .live-figure")
        assert figure.locator(":scope > img").is_visible()
        figure.get_by_role("radio").first.check()
        figure.locator(".play").click()
        page.wait_for_function("() => Number(document.querySelector('.live-figure').dataset.step) > 3")
        figure.locator(".play").click()
        step = figure.get_attribute("data-step")
        page.wait_for_timeout(500)
        assert figure.get_attribute("data-step") == step
        assert troubles == []
