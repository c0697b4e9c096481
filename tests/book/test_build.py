"""What the build adds: lighter pictures, and how long a chapter takes."""

import nbformat
import pytest
from PIL import Image

from build import lighten, mend_pages
from reader_extension import count_reading, count_words

cell = nbformat.v4.new_code_cell
words = nbformat.v4.new_markdown_cell


def test_large_pictures_become_lighter_and_stay_linked(tmp_path):
    (tmp_path / "_images").mkdir()
    noise = Image.effect_noise((300, 300), 60)
    noise.save(tmp_path / "_images" / "large.png")
    Image.new("RGB", (9, 9)).save(tmp_path / "_images" / "small.png")
    (tmp_path / "a.html").write_text('<img src="_images/large.png"><img src="_images/small.png">')
    before = (tmp_path / "_images" / "large.png").stat().st_size
    lighten(tmp_path)
    assert (tmp_path / "a.html").read_text(
        encoding="utf-8"
    ) == '<img src="_images/large.webp"><img src="_images/small.png">'
    assert {file.name for file in (tmp_path / "_images").iterdir()} == {"large.webp", "small.png"}
    assert (tmp_path / "_images" / "large.webp").stat().st_size < before


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (
            '<script defer src="../_static/scripts/fontawesome.js?digest=1"></script><script src="b.js"></script>',
            '<script src="b.js"></script>',
        ),
        ('<div role="list" class="citation-list">x</div>', '<div class="citation-list">x</div>'),
        (
            '<dl><dt class="sig sig-object">f(<dl><dd>x</dd></dl>)</dt><dd>words</dd></dl>',
            '<dl><dt class="sig sig-object">f(<div class="sig-parameters"><div>x</div></div>)</dt><dd>words</dd></dl>',
        ),
    ],
)
def test_pages_are_mended(tmp_path, before, after):
    script, page = tmp_path / "_static/scripts/fontawesome.js", tmp_path / "api/a.html"
    for file, text in ((script, ""), (page, before)):
        file.parent.mkdir(parents=True)
        file.write_text(text)
    mend_pages(tmp_path)
    assert page.read_text(encoding="utf-8") == after
    assert not script.exists()


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("# Two words", 2),
        ("A formula $x + y$ counts.", 4),
        ("$$\nx = y\n$$\nafter it", 2),
        (":::{prf:theorem} Name\n:label: thm-x\nIt holds.\n:::", 2),
        ("see [the place](#fig-x) {cite:p}`key`", 4),
    ],
)
def test_words_are_counted_as_read(text, number):
    assert count_words(text) == number


def test_a_chapter_is_counted_up_to_its_exercises():
    picture = nbformat.v4.new_output("display_data", {"image/png": "iVBO"})
    ran = nbformat.v4.new_output("stream", text="seed 0; ran in 12 s")
    notebook = nbformat.v4.new_notebook(
        cells=[
            words("# Title\n\n" + "word " * 399 + "\n\n$$\nx = 1\n$$"),
            cell("x = 1\n\ny = 2", outputs=[picture]),
            cell("import this", metadata={"tags": ["imports"]}),
            words("## Exercises\n\n### ★ One\n\nmany words"),
            words("### ★★★ Two"),
            cell("solve()", outputs=[ran]),
        ]
    )
    found = count_reading(notebook)
    assert found == (400, 1, 0, 1, 25, 2, 12)
    assert found.minutes == 3  # 2 for the words, 36 s for a figure, a formula and two lines
    assert found.head == (
        "About 3 minutes to read, and 25 for the exercises: 400 words, 1 figures and tables. The code ran in 12 s."
    )
