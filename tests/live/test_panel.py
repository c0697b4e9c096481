"""The machine of a live figure: the question comes first, the theme is that of the book, paper shows the still."""

import itertools
import re
from collections import defaultdict

import pytest
from live_pages import BY_KIND, DATA, live_page_of

from browser import SET_THEME, page_file, watched_page
from meshot.view.page import joined

LIVE = (".plots", ".status", ".controls", ".seen")
GROUND = "() => getComputedStyle(document.querySelector('.live-figure')).backgroundColor"


@pytest.fixture
def untouched(tmp_path, context):
    """Opens a figure and leaves it alone."""
    ends = []

    def open_figure(name):
        watching = watched_page(context, page_file(tmp_path, live_page_of(name)))
        page, troubles = watching.__enter__()
        ends.append((watching, troubles))
        return page

    yield open_figure
    for watching, troubles in ends:
        assert troubles == []
        watching.__exit__(None, None, None)


@pytest.mark.parametrize("name", BY_KIND)
@pytest.mark.parametrize("way", ["an answer", "no answer", "an address"])
def test_the_still_stays_until_the_reader_has_predicted(name, way, untouched):
    page = untouched(name)
    assert page.locator(".live-figure > img").is_visible()
    assert page.locator(".question").is_visible()
    assert all(page.locator(part).is_hidden() for part in LIVE)
    assert page.locator(".plots svg > g:nth-of-type(2) > *").count() == 0  # nothing was drawn
    still, question = (page.locator(part).bounding_box()["y"] for part in (".live-figure > img", ".question"))
    assert question < still
    if way == "an answer":
        page.get_by_role("radio", name="no", exact=True).first.check()
    elif way == "no answer":
        page.get_by_role("button", name="just show me").click()
    else:
        page.goto(f"{page.url}#{name}=%7B%7D")
        page.reload()
    assert page.locator(".live-figure > img").is_hidden()
    assert page.get_by_role("button", name="just show me").is_hidden()
    assert all(page.locator(part).is_visible() for part in LIVE)
    assert page.locator(".question").is_visible()


OTHER_THEMES = ("body.jpThemeLight", "vscode")
DARK = [(name, "html.theme") for name in DATA] + [("turning", theme) for theme in OTHER_THEMES]
DARK += [
    pytest.param(name, theme, marks=pytest.mark.thorough)
    for name, theme in itertools.product(sorted(set(DATA) - {"turning"}), OTHER_THEMES)
]


@pytest.mark.parametrize(("name", "mark"), DARK)
def test_a_figure_is_dark_where_the_page_is(name, mark, untouched):
    page = untouched(name)
    page.get_by_role("button", name="just show me").click()
    assert page.evaluate(GROUND) == "rgb(255, 255, 255)"
    if mark == "html.theme":
        page.evaluate(SET_THEME, "dark")
    elif mark == "vscode":
        page.evaluate("() => document.body.classList.add('vscode-dark')")
    else:
        page.evaluate("() => (document.body.dataset.jpThemeLight = 'false')")
    assert page.evaluate(GROUND) == "rgb(20, 24, 30)"
    inks = "() => [...document.querySelectorAll('.plots text:not([fill])')].map((node) => getComputedStyle(node).fill)"
    assert set(page.evaluate(inks)) <= {"rgb(230, 230, 230)"}
    # No mark has a colour that the theme does not know, but on a picture, which is the same in both themes.
    plots = page.locator(".plots").inner_html()
    assert "<image" in plots or not re.search(r'="#[0-9a-fA-F]{3}', plots)


@pytest.mark.parametrize("name", BY_KIND)
def test_paper_shows_the_still(name, untouched):
    page = untouched(name)
    page.get_by_role("button", name="just show me").click()
    page.emulate_media(media="print")
    assert page.locator(".live-figure > img").is_visible()
    assert not any(page.locator(part).is_visible() for part in (*LIVE, ".question"))


@pytest.mark.parametrize("name", DATA)
def test_no_two_scripts_of_a_figure_declare_one_name(name):
    """All parts of a bundle share a scope, where a second function of a name would silently replace the first."""
    script = joined("meshot/view/assets/wake.js", f"meshot_book/live/figures/assets/{name}.js")
    counts = defaultdict(int)
    depth = 0
    for line in script.splitlines():
        found = re.match(r"(?:async )?(?:function|const|let|class) (\w+)", line)
        if found and depth == 0:
            counts[found[1]] += 1
        bare = re.sub(r"\"[^\"]*\"|'[^']*'|`[^`]*`|//.*", "", line)
        depth += sum(map(bare.count, "({[")) - sum(map(bare.count, ")}]"))
    assert len(counts) > 10
    assert {key for key, count in counts.items() if count > 1} == set()
