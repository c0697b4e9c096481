"""Every page as a reader meets it: whole, within its column at three widths, open to all, and light to load.

Each page is opened once. What is found on the way is what the tests look at.
"""

from pathlib import Path
from typing import NamedTuple

import pytest

import build
from browser import barriers, broken_links, raw_tex, sideways, watched_page, weight

#: Pages of the API come from one template: two of them stand for all when axe-core looks.
API_LOOKED_AT = ("meshot.html", "meshot.loss.html")
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


@pytest.fixture(scope="module")
def visits(html, context) -> dict[str, Visit]:
    """Every page of the book, by its name."""
    files = sorted([*html.glob("*.html"), *html.glob("api/*.html")])
    return {file.relative_to(html).as_posix(): visit(context, file) for file in files}


def test_every_page_is_whole_without_a_network(visits, capsys):
    with capsys.disabled():
        print(f"\nopened {len(visits)} pages offline: {', '.join(visits)}")
    assert {name: seen.troubles for name, seen in visits.items() if seen.troubles} == {}
    chapters = {path.stem for path in (build.ROOT / "notebooks").glob("[0-9]*.md")}
    assert {f"api/{name}" for name in API_LOOKED_AT} <= set(visits)
    wanted = chapters | {"index", "ledger", "search", "references", "meshot", "meshot.loss"}
    assert wanted <= {Path(name).stem for name in visits}


def test_nothing_scrolls_sideways_or_is_clipped(visits):
    assert {name: seen.sideways for name, seen in visits.items() if seen.sideways} == {}


def test_no_page_shuts_a_reader_out(visits):
    assert {name: seen.barriers for name, seen in visits.items() if seen.barriers} == {}


def test_no_page_is_heavy(visits, capsys):
    heaviest = sorted(visits, key=lambda name: -visits[name].weight)
    with capsys.disabled():
        print("\nkB as sent: " + ", ".join(f"{name} {visits[name].weight / 1000:.0f}" for name in heaviest[:20]))
    assert [name for name in heaviest if visits[name].weight > HEAVIEST] == []


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
        assert page.locator(".moving button[data-moving]").text_content() == "▶ play"
    calm.close()


def test_the_landing_page_moves_and_can_be_stopped(html, context):
    with watched_page(context, html / "index.html") as (page, _):
        button = page.locator(".moving button[data-moving]")
        assert button.text_content() == "❚❚ pause"
        button.click()
        assert button.text_content() == "▶ play"
        page.wait_for_timeout(3000)
        assert button.text_content() == "▶ play"
