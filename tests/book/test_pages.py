"""The rendered book in a browser without a network: its formulas, search, theme, players and the entries of its API."""

import json
import re
from pathlib import Path

import pytest
import yaml
from bs4 import BeautifulSoup

import build
from api_pages import set_formulas
from browser import raw_tex, troubles_of, watched_page
from house import shown_names
from rendered import chapter_pages


def test_formulas_are_set(html, context):
    with watched_page(context, html / "notation.html") as (page, _):
        assert page.locator("mjx-container").count() > 10
        assert raw_tex(page) == []


def test_search_finds_a_page(html, context):
    with watched_page(context, html / "search.html") as (page, troubles):
        page.goto((html / "search.html").as_uri() + "?q=wasserstein")
        page.wait_for_selector("ul.search li", timeout=10_000)
        assert page.locator("ul.search li").count() >= 2
        assert troubles == []


def test_dark_mode_darkens(html, context):
    brightness = "() => getComputedStyle(document.body).backgroundColor.match(/[0-9]+/g).slice(0, 3).map(Number)"
    with watched_page(context, html / "index.html") as (page, troubles):
        seen = {}
        for mode in ("light", "dark"):
            page.locator("button.theme-switch-button:visible").first.click()
            page.locator(f"button.theme-change-button[data-mode={mode}]:visible").first.click()
            seen[mode] = sum(page.evaluate(brightness))
        assert seen["dark"] < seen["light"] - 300
        assert troubles == []


def test_a_chapter_can_be_downloaded_as_a_notebook(html, context):
    with watched_page(context, html / "01_circle_to_polygon.html") as (page, _):
        (reference,) = set(page.eval_on_selector_all("a[href$='.ipynb']", "e => e.map(x => x.getAttribute('href'))"))
    notebook = json.loads((html / reference).read_text(encoding="utf-8"))
    stored = build.ROOT / "notebooks" / "01_circle_to_polygon.ipynb"
    assert notebook == json.loads(stored.read_text(encoding="utf-8"))


def test_the_addresses_of_before_lead_to_the_chapters_of_now(html, context):
    moved = yaml.safe_load(build.MOVED.read_text(encoding="utf-8"))
    now = {path.stem for path in (build.ROOT / "notebooks").glob("[0-9]*.md")}
    assert set(moved.values()) <= now
    assert not now & set(moved)
    assert all((html / f"{name}.html").is_file() for name in moved)
    assert {page.stem for page in chapter_pages(html)} == now
    with watched_page(context, html / "index.html") as (page, troubles):
        page.goto((html / "20_flows.html").as_uri() + "#further-reading")
        page.wait_for_url("**/12_flows.html#further-reading")
        assert page.locator("h1").first.text_content().startswith("Flows")
        assert troubles == []


def test_a_surface_of_the_book_can_be_turned(html, context):
    with watched_page(context, html / "23_a_real_scan.html") as (page, troubles):
        page.locator(".surface-scene .start").first.click()
        canvas = page.locator(".surface-scene canvas").first
        canvas.wait_for(timeout=20_000)
        before = canvas.screenshot()
        for _ in range(8):
            canvas.press("ArrowLeft")
        page.wait_for_timeout(300)
        assert canvas.screenshot() != before
        assert troubles == []


def test_the_points_of_the_book_can_be_played(html, context):
    with watched_page(context, html / "01_circle_to_polygon.html") as (page, troubles):
        figure = page.locator(".live-figure").first
        figure.get_by_role("button", name="just show me").click()
        status = figure.locator(".status")
        assert "Step 0." in status.text_content()
        figure.get_by_role("button", name="one step").click()
        assert "Step 1." in status.text_content()
        assert troubles == []


def lacks(html: Path, door: str, name: str) -> str:
    """What is missing of a name on the page of its door."""
    page = html / "api" / f"{door}.html"
    entry = re.search(rf'<dt [^>]*id="{re.escape(door)}\.{name}">(.*?)</dt>', page.read_text("utf-8"), re.S)
    if not entry:
        return f"{door}.{name}: no entry"
    link = re.search(r'href="([^"]*_modules/[^"#]*)#([^"]*)"', entry[1])
    if not link:
        return f"{door}.{name}: no source link"
    source = (page.parent / link[1]).resolve()
    found = source.is_file() and f'id="{link[2]}"' in source.read_text("utf-8")
    return "" if found else f"{door}.{name}: its source link leads nowhere"


def test_every_name_at_every_door_has_an_entry_and_its_source(html):
    src = build.ROOT / "src"
    stubs = {".".join(stub.parent.relative_to(src).parts): stub for stub in src.rglob("__init__.pyi")}
    troubles = [lacks(html, door, name) for door, stub in stubs.items() for name in shown_names(stub)]
    assert len(stubs) > 15
    assert [trouble for trouble in troubles if trouble] == []
    assert {page.stem for page in html.glob("api/*.html")} == {"index", "meshot.statistics", *stubs}


def powers(page: Path) -> list[str]:
    """Powers that a reader of a page sees as plain letters, such as W_p^p, with what stands around them."""
    article = BeautifulSoup(page.read_text("utf-8"), "html.parser").select_one("article")
    for tag in article.select("pre, .math, dt.sig"):
        tag.decompose()
    return re.findall(r".{0,20}\^.{0,20}", article.get_text())


def test_powers_are_formulas_on_the_pages_of_the_api(html):
    assert {page.stem: found for page in html.glob("api/*.html") if (found := powers(page))} == {}


def test_a_docstring_in_a_terminal_and_on_a_page():
    lines = [
        "SW_p^p in R^6, in (units of the points)^p; ``R^6`` is code.",
        ">>> f(x)",
        "a point in R^6",
        "",
        "‖x − y‖₂^p",
    ]
    assert set_formulas(lines) == [
        r":math:`\SW_p^p` in :math:`\R^6`, in :math:`(\text{units of the points})^p`; ``R^6`` is code.",
        *lines[1:4],
        r":math:`\lVert x - y \rVert_2^p`",
    ]


@pytest.mark.parametrize(
    ("body", "seen"),
    [
        ('<img src="https://example.org/a.png">', "request leaves"),
        ("<script>console.error('no')</script>", "console: no"),
        ("<script>undefined_function()</script>", "script error"),
        ("<p>The cost $$x^{2}$$ is unset</p>", "raw TeX"),
        ('<a href="nowhere.html">x</a>', "broken link"),
        ('<a href="#nowhere">x</a>', "link to no place"),
        ('<img src="lost.png">', "request failed"),
    ],
)
def test_each_trouble_is_seen(tmp_path, context, body, seen):
    file = tmp_path / "page.html"
    file.write_text(f"<!doctype html><html><body><article>{body}</article></body></html>")
    assert any(seen in trouble for trouble in troubles_of(context, file))


def test_a_good_page_has_no_trouble(tmp_path, context):
    file = tmp_path / "page.html"
    file.write_text('<!doctype html><html><body><article id="a"><a href="#a">up</a> costs 5 $</article></body></html>')
    assert troubles_of(context, file) == []
