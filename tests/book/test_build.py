"""The rendered book is whole or as it was. The build stores lighter pictures and counts how long a chapter takes."""

import nbformat
import pytest
from PIL import Image

import build
from build import drop_icon_script, lighten, mend_roles, mend_signatures
from reading import count_reading, count_words, read_chapters, reading_table

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
    assert (tmp_path / "a.html").read_text() == '<img src="_images/large.webp"><img src="_images/small.png">'
    assert {file.name for file in (tmp_path / "_images").iterdir()} == {"large.webp", "small.png"}
    assert (tmp_path / "_images" / "large.webp").stat().st_size < before


def test_icons_come_from_the_font_alone(tmp_path):
    script = tmp_path / "_static" / "scripts" / "fontawesome.js"
    script.parent.mkdir(parents=True)
    script.touch()
    (tmp_path / "api").mkdir()
    page = tmp_path / "api" / "a.html"
    page.write_text(
        '<script defer src="../_static/scripts/fontawesome.js?digest=1"></script><script src="b.js"></script>'
    )
    drop_icon_script(tmp_path)
    assert page.read_text() == '<script src="b.js"></script>'
    assert not script.exists()


def test_references_are_no_list_without_items(tmp_path):
    page = tmp_path / "references.html"
    page.write_text('<div role="list" class="citation-list">x</div>')
    mend_roles(tmp_path)
    assert page.read_text() == '<div class="citation-list">x</div>'


def test_a_long_signature_becomes_blocks(tmp_path):
    (tmp_path / "api").mkdir()
    page = tmp_path / "api" / "a.html"
    page.write_text('<dl><dt class="sig sig-object">f(<dl><dd>x</dd></dl>)</dt><dd>words</dd></dl>')
    mend_signatures(tmp_path)
    blocks = '<div class="sig-parameters"><div>x</div></div>'
    assert page.read_text() == f'<dl><dt class="sig sig-object">f({blocks})</dt><dd>words</dd></dl>'


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
            words("# Title\n\n" + "word " * 399),
            cell("x = 1\n\ny = 2", outputs=[picture]),
            cell("import this", metadata={"tags": ["imports"]}),
            words("## Exercises\n\nmany words"),
            cell("solve()", outputs=[ran]),
        ]
    )
    found = count_reading(notebook)
    assert found == (400, 1, 2, 2, 1, 12)
    assert found.minutes == 2
    assert found.head == "About 2 minutes to read: 400 words, 1 figures and tables. The code ran in 12 s."
    assert reading_table({"01_a": found}).splitlines()[-1] == "| 01 | 400 | 1 | 2 | 2 | 1 | 12 |"


LONGEST_READING = 45


def test_no_chapter_takes_longer_than_a_lesson(root):
    minutes = {name[:2]: one.minutes for name, one in read_chapters(root / "notebooks").items()}
    assert len(minutes) > 10
    assert {number: taken for number, taken in minutes.items() if taken > LONGEST_READING} == {}


@pytest.fixture
def render_page(monkeypatch, tmp_path):
    """Render a book of one page into a folder; the exit status."""

    def run(page: str) -> int:
        def assemble(notebooks, source):
            source.mkdir(parents=True)
            (source / "conf.py").write_text("project = 'small'\n")
            (source / "index.rst").write_text(page)

        monkeypatch.setattr(build, "assemble", assemble)
        return build.build("stored", tmp_path / "into")

    return run


def test_a_book_takes_the_place_of_the_one_before_and_leaves_nothing_else(render_page, tmp_path, capfd):
    for word in ("first", "second"):
        assert render_page(f"A title\n=======\n\n{word}\n") == 0
        html = tmp_path / "into" / "html"
        assert word in (html / "index.html").read_text(encoding="utf-8")
        assert [path.name for path in (tmp_path / "into").iterdir()] == ["html"]
        assert str(html / "index.html") in capfd.readouterr().out


def test_the_book_before_stays_if_a_warning_stops_the_new_one(render_page, tmp_path, capfd):
    assert render_page("A title\n=======\n\nsound\n") == 0
    assert render_page("A title\n=======\n\n:ref:`nowhere`\n") == 1
    assert "the book was not rendered" in capfd.readouterr().out
    html = tmp_path / "into" / "html"
    assert "sound" in (html / "index.html").read_text(encoding="utf-8")
    assert [path.name for path in (tmp_path / "into").iterdir()] == ["html"]


def test_a_chapter_that_was_not_run_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(build, "ROOT", tmp_path)
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "book").mkdir()
    (tmp_path / "notebooks" / "01_a.md").write_text("# A\n")
    assert build.build("stored", tmp_path / "into") == 1
    assert "run the notebooks first" in capsys.readouterr().out
