"""The rules for prose that can be tested, held by every page that has been rewritten."""

import re

import nbformat
import pytest

from prose import lapses, sentences, unopened

#: Chapters that are still to be rewritten. This list only becomes shorter.
TO_REWRITE = {"01", "02", "03", "04", "10", "11", "12", "20", "21", "30", "31", "33"}
PAGES = ("index", "getting_started", "howto", "teaching", "limits", "notation")


def chapter_text(path) -> str:
    """The text of a chapter; a cell of code stands as a fence."""
    cells = nbformat.read(path, as_version=4).cells
    return "\n\n".join(cell.source if cell.cell_type == "markdown" else "```\n```" for cell in cells)


def pytest_generate_tests(metafunc):
    if "chapter" in metafunc.fixturenames:
        paths = sorted((metafunc.config.rootpath / "notebooks").glob("[0-9][0-9]_*.ipynb"))
        metafunc.parametrize("chapter", paths, ids=lambda path: path.stem)


def test_a_chapter_keeps_the_rules(chapter):
    if chapter.stem[:2] in TO_REWRITE:
        pytest.skip("still to be rewritten")
    assert lapses(chapter_text(chapter)) == []


@pytest.mark.parametrize("name", PAGES)
def test_a_page_keeps_the_rules(root, name):
    assert lapses((root / "book" / f"{name}.md").read_text(encoding="utf-8")) == []


def test_the_ledger_keeps_its_sentences_short(root):
    text = (root / "book" / "ledger.md").read_text(encoding="utf-8")
    unfolded = re.sub(r"^::::\{dropdown\}.*?^::::$", "", text, flags=re.M | re.S)
    assert lapses(unfolded) == []


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("word " * 41 + ".", "41 words"),
        ("A loss sees points.", "losses do not speak"),
        ("There are dozens.", "give the number"),
        ("Of course it holds.", "say the reason"),
        ("## Head\n\n```\n```\n", "no sentence opens the section 'Head'"),
        ("## Head\n\n- item\n", "no sentence opens"),
        ("## Head\n\n### Next\n\nWords.", "no sentence opens the section 'Head'"),
    ],
)
def test_each_lapse_is_seen(text, seen):
    assert any(seen in found for found in lapses(text))


def test_good_prose_has_no_lapse():
    text = "## Head\n\nThe loss of $x$ is small, e.g. 3 mm. [Table](#tab-a) shows it:\n\n- one\n- two\n\n| a |\n|---|\n"
    assert lapses(text) == []
    assert list(sentences(text)) == ["The loss of formula is small, eg 3 mm.", "Table shows it:", "- one", "- two"]
    assert unopened("# Title\n\n**Bold** words.\n") == []
