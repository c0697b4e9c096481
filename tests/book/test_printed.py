"""Slides, the printed book and the two editions, made from a small rendered page and a small notebook."""

import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from browser import watched_page
from editions import YOUR_TURN, board_notes, instructor_edition, student_edition
from pdf import joined_link, write_document
from rendered import read_article
from slides import chapter_slides, write_all

PAGE = (
    """<!doctype html><html><body><article><section id="top"><h1>10 Trial<a class="headerlink" href="#top">#</a></h1>
<ul><li>add numbers</li></ul>
<section id="sums"><h2>10.1 Sums</h2><p>This section adds. See <a href="20_other.html#there">there</a>.</p>
<div class="math">\\[1 + 1\\]</div><p>More words on sums.</p>
<div class="cell"><details class="hide"><summary>Show code</summary><div class="cell_input"><pre>folded()</pre></div>
</details><div class="cell_output"><figure id="fig-a"><img src="_images/a.png" alt="a picture">
<figcaption>Figure 10.1</figcaption></figure></div></div>
<div class="cell"><div class="cell_input"><pre>print(2)</pre></div><div class="cell_output"><pre>2</pre></div></div>
<div class="cell"><div class="cell_input"><pre>"""
    + "x = 1\n" * 60
    + """</pre></div></div>
</section>
<section id="questions"><h2>10.2 Questions</h2><div class="quiz">ask</div></section>
<section id="ex"><h2>10.3 Exercises</h2><section><h3>Add two</h3><p>Try.</p></section></section>
</section></article></body></html>"""
)


@pytest.fixture
def html(tmp_path) -> Path:
    """A rendered book of two chapters."""
    tmp_path = tmp_path / "html"
    tmp_path.mkdir()
    (tmp_path / "10_trial.html").write_text(PAGE)
    (tmp_path / "20_other.html").write_text('<article><section id="there"><h1>20 Other</h1></section></article>')
    (tmp_path / "_images").mkdir()
    (tmp_path / "_images" / "a.png").write_bytes(
        (Path(__file__).parents[2] / "book/_static/circle_to_polygon.png").read_bytes()
    )
    (tmp_path / "_static" / "mathjax").mkdir(parents=True)
    for name in ("pygments.css", "mathjax/tex-chtml.js"):
        (tmp_path / "_static" / name).write_text("")
    return tmp_path


def test_each_slide_shows_one_thing(html):
    slides = chapter_slides(read_article(html / "10_trial.html"))
    shown = [slide.content for slide in slides]
    marks = ["10 Trial", "add numbers", "This section adds", "Figure 10.1", "print(2)", "x = 1", "Add two"]
    assert len(shown) == len(marks)
    assert all(mark in content for mark, content in zip(marks, shown, strict=True))
    assert "1 + 1" in slides[2].content
    assert slides[2].notes == "<p>More words on sums.</p>"
    assert slides[3].section == "10.1 Sums"
    assert not any(words in "".join(shown) for words in ("folded()", "headerlink", "ask"))


def test_slides_need_no_network_and_fit(html, context):
    write_all(html)
    with watched_page(context, html / "slides" / "10_trial.html") as (page, troubles):
        page.set_viewport_size({"width": 1280, "height": 720})
        page.wait_for_function("() => window.Reveal && Reveal.isReady()")
        assert page.evaluate("Reveal.getTotalSlides()") == 7
        for index in range(7):
            page.evaluate("(index) => Reveal.slide(index)", index)
            page.wait_for_timeout(100)
            box = page.locator("section.present .content").bounding_box()
            assert box["y"] + box["height"] <= 720, index
        assert page.locator("section a").first.get_attribute("href") == "../20_other.html#there"
        assert troubles == []


def test_no_chapter_is_said(tmp_path):
    with pytest.raises(ValueError, match="holds no rendered chapter; render the book first"):
        write_all(tmp_path)


def test_the_book_is_one_document_with_links_within(html):
    document = write_document(html)
    text = document.read_text(encoding="utf-8")
    assert 'href="#20_other--there"' in text
    assert 'id="20_other--there"' in text
    assert 'id="10_trial--fig-a"' in text
    assert "folded()" not in text


def test_the_book_is_printed(html, root):
    subprocess.run([sys.executable, root / "book" / "pdf.py", "--html", html], check=True)
    assert (html.parent / "meshes_as_measures.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("link", "leads"),
    [
        ("#a", "#10_trial--a"),
        ("20_other.html", "#20_other"),
        ("20_other.html#b", "#20_other--b"),
        ("api/index.html#c", "api/index.html#c"),
        ("_images/a.png", "_images/a.png"),
    ],
)
def test_links_lead_within_the_document(link, leads):
    assert joined_link(link, "10_trial", {"10_trial", "20_other"}) == leads


GUIDE = "# Guide\n\n## On the board\n\n- **10**: draw a triangle\n  and a line.\n- **11**: write.\n\n## Next\n"


def test_editions_differ_in_solutions_and_board_notes():
    assert board_notes(GUIDE) == {"10": "draw a triangle and a line.", "11": "write."}
    words, code = nbformat.v4.new_markdown_cell, nbformat.v4.new_code_cell
    output = nbformat.v4.new_output("stream", text="✓ right")
    source = nbformat.v4.new_notebook(
        cells=[
            words("# Trial"),
            code("def f(): ..."),
            words(":::{dropdown} Hint\nthink\n:::"),
            code("def f(): return 1", metadata={"tags": ["solution"]}, outputs=[output]),
            words("**More to try**\n\n:::{dropdown} Answers\n- secret\n:::\nafter"),
        ]
    )
    student = student_edition(source)
    text = "".join(cell.source for cell in student.cells)
    assert "return 1" not in text
    assert "secret" not in text
    assert text.count(YOUR_TURN) == 2
    assert "think" in text
    assert text.endswith("after")
    nbformat.validate(student)
    instructor = instructor_edition(source, "draw a triangle and a line.")
    assert instructor.cells[1].source == "**On the board.** draw a triangle and a line."
    assert [cell.source for cell in source.cells] == [
        cell.source for cell in instructor.cells if cell.id != "on-the-board"
    ]
    nbformat.validate(instructor)
