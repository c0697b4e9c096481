"""The gallery: every figure of the stored notebooks is in it, filters answer, and links lead to figures and to code."""

import base64
import io
import re
from urllib.parse import urlsplit

import nbformat
import pytest
import yaml
from bs4 import BeautifulSoup
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image

from browser import barriers, broken_links, set_width, sideways, watched_page
from gallery_extension import WIDTH, Shown, concepts_of, shown_figures, thumbnail


def png(colour, size=(640, 480)):
    buffer = io.BytesIO()
    Image.new("RGBA", size, colour).save(buffer, "PNG")
    return base64.b64encode(buffer.getvalue()).decode()


def shown(data, caption=None, alt=None, tags=(), name="fig-a"):
    about = {"figure": {"name": name, "caption": caption}} if caption else {}
    about |= {"image": {"alt": alt}} if alt else {}
    cell = new_code_cell("f()", outputs=[new_output("display_data", data)])
    cell.metadata.update({"mystnb": about, "tags": list(tags)})
    return cell


def test_figures_are_found_with_what_is_said_of_them():
    still = f'<img src="data:image/png;base64,{png("red")}">'
    asked = (
        f'<div class="meshot-page" aria-label="a &lt;b&gt;">{still}<legend><b>Predict first.</b> Is\n2 &gt; 1?</legend>'
    )
    cells = [
        new_markdown_cell("# Title\n\n```text\n# no heading\n```"),
        shown({"image/png": png("blue")}, "Two points. Left, one.", "points"),
        new_markdown_cell("## Part {#part}"),
        shown({"text/html": asked}),
        shown({"text/html": f'<div class="meshot-page" aria-label="turn me">{still}'}),
        shown({"image/png": png("green")}, "The answer.", tags=["solution"]),
        shown({"text/html": "<table></table>"}, "A table."),
        shown({"text/plain": "3"}),
    ]
    found = list(shown_figures(new_notebook(cells=cells), "01_a"))
    assert [one[2:6] for one in found] == [
        ("still", "fig-a", "Title", "Two points. Left, one."),
        ("live", None, "Part", "Is 2 > 1?"),
        ("interactive", None, "Part", "turn me"),
    ]
    assert found[1].text == "Title Part Is 2 > 1?  a <b>"
    assert [Image.open(io.BytesIO(one.picture)).getpixel((0, 0))[:3] for one in found[::2]] == [
        (0, 0, 255),
        (255, 0, 0),
    ]


def figure(text):
    return Shown("01_a", "cell-001", "still", None, "", "", text, b"")


def test_a_concept_is_known_by_the_beginning_of_a_word():
    concepts = {"flows": ["flow"], "blur": ["blur", "sinkhorn"]}
    assert concepts_of([figure("Sinkhorn on two Flows"), figure("overflow, blurred")], concepts) == [
        ["flows", "blur"],
        ["blur"],
    ]
    with pytest.raises(ValueError, match="01_a, cell-001: its text has no word"):
        concepts_of([figure("flow blur"), figure("overflow")], concepts)
    with pytest.raises(ValueError, match="no figure shows flows"):
        concepts_of([figure("blur")], concepts)


def test_a_small_picture_is_on_white_and_keeps_its_shape():
    small = thumbnail(base64.b64decode(png((0, 0, 0, 0))))
    assert small.size == (WIDTH, WIDTH * 480 // 640)
    assert small.getpixel((5, 5)) == (255, 255, 255)


@pytest.fixture(scope="module")
def items(html):
    return BeautifulSoup((html / "gallery.html").read_text(encoding="utf-8"), "html.parser").select(".gallery > li")


def test_every_figure_of_the_notebooks_is_in_the_gallery(root, html, items):
    wanted = []
    for file in sorted((root / "notebooks").glob("[0-9]*.ipynb")):
        for cell in nbformat.read(file, as_version=4).cells:
            outputs = cell.get("outputs", []) if "solution" not in cell.metadata.get("tags", []) else []
            for data in (output.get("data", {}) for output in outputs):
                page = data.get("text/html", "")
                if "image/png" in data or "data:image" in page:
                    kind = "still" if "image/png" in data else "live" if "data-figure=" in page else "interactive"
                    wanted.append((file.stem[:2], cell.id, kind))
    listed = [(item["data-chapter"], item.select("a")[-1]["href"].split("#")[1], item["data-kind"]) for item in items]
    assert listed == [(chapter, f"{cell}-code", kind) for chapter, cell, kind in wanted]
    assert sum(kind == "live" for *_, kind in wanted) >= 6
    assert all((html / item.img["src"]).is_file() for item in items)
    assert all(len(item.select("p")[1].get_text()) > 15 for item in items)


def test_links_lead_to_the_figure_and_to_its_code(html, items):
    """The picture at the place is that of the cell, in number and in the chapter."""
    pages = {}
    for item in items[::7]:
        place, code = (urlsplit(item.select(link)[-1]["href"]) for link in (".gallery-place a", ".gallery-cell a"))
        if place.path not in pages:
            pages[place.path] = BeautifulSoup((html / place.path).read_text(encoding="utf-8"), "html.parser")
        page = pages[place.path]
        assert place.path == code.path
        cell = page.find(id=code.fragment.removesuffix("-code"))
        assert page.find(id=code.fragment).find_parent(id=cell["id"]) is not None
        figure = page.find(id=place.fragment)
        assert figure is cell or cell in figure.parents or figure in [*cell.parents, *cell.descendants]
        number = item.select_one(".gallery-place").get_text()
        if number.startswith("Figure "):
            assert number in figure.find_parent().get_text()


def test_the_gallery_has_no_barriers_at_any_width(html, context):
    with watched_page(context, html / "gallery.html") as (page, troubles):
        assert broken_links(page, html / "gallery.html") == []
        assert sideways(page) == []
        assert troubles == []
        set_width(page, 1280)
        assert barriers(page) == []


def test_filters_answer_keys_and_addresses(root, html, context, items):
    concepts = yaml.safe_load((root / "book" / "concepts.yaml").read_text(encoding="utf-8"))
    with watched_page(context, html / "gallery.html") as (page, troubles):
        shown_items = page.locator(".gallery > li:visible")
        said = page.locator(".gallery-said")
        assert shown_items.count() == len(items)
        assert page.locator("select[name=concept] option").count() == len(concepts) + 1
        page.get_by_label("Chapter").focus()
        page.keyboard.type("03")  # as in every list of choices
        chapter = [item for item in items if item["data-chapter"] == "03"]
        assert shown_items.count() == len(chapter) > 0
        assert said.text_content() == f"{len(chapter)} figures of {len(items)}"
        page.get_by_label("Concept").select_option("flows")
        page.get_by_label("Chapter").select_option("20")
        both = [i for i in items if i["data-chapter"] == "20" and "flows" in i["data-concepts"].split("|")]
        assert shown_items.count() == len(both) > 0
        assert page.url.endswith("#chapter=20&concept=flows")
        page.reload()
        assert shown_items.count() == len(both)
        page.get_by_role("button", name="all figures").click()
        page.wait_for_function(f"() => document.querySelector('.gallery-said').textContent === '{len(items)} figures'")
        assert shown_items.count() == len(items)
        page.goto(page.url.split("#")[0] + "#kind=live&concept=nonsense")
        page.reload()
        assert shown_items.count() == sum(item["data-kind"] == "live" for item in items)
        assert troubles == []


def test_a_link_to_code_unfolds_it(html, context):
    with watched_page(context, html / "gallery.html") as (page, troubles):
        page.locator("li[data-kind=live] .gallery-cell a").last.click()
        page.wait_for_url(re.compile(r"-code$"))
        code = page.locator("#" + page.url.split("#")[1])
        code.locator("pre").first.wait_for(state="visible", timeout=10_000)
        assert "live_figure(" in code.text_content()
        assert troubles == []
