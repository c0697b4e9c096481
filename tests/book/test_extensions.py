"""A book of one chapter, run and rendered: what is folded, numbered, linked and asked, as a reader finds it."""

import errno
import os
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import nbformat
import pytest
from sphinx.errors import ExtensionError

import build
from browser import set_width, troubles_of, watched_page
from meshot_book.notebook import KERNEL_ENVIRONMENT
from quiz_extension import read_quiz
from run_notebooks import retold_notebook, run_notebook

TRIAL = Path(__file__).parent / "trial"
CONFIGURATION = """
import sys
from pathlib import Path
sys.path.insert(0, str(Path(__file__).parent))
from book_conf import *
for name in ("api_extension", "commands_extension"):
    extensions.remove(name)
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """The trial chapter, run."""
    notebook = tmp_path_factory.mktemp("run") / "10_trial.ipynb"
    before = dict(os.environ)
    os.environ.update(KERNEL_ENVIRONMENT)
    nbformat.write(run_notebook(TRIAL / "10_trial.md", SimpleNamespace(update=lambda: None)), notebook)
    os.environ.clear()
    os.environ.update(before)
    shutil.copy(TRIAL / "10_trial.md", notebook.parent)
    return notebook


def assemble(source: Path, notebook: Path) -> Path:
    """The source of the trial book, without API pages."""
    shutil.copytree(TRIAL, source, ignore=shutil.ignore_patterns("10_trial.md"))
    shutil.copytree(build.ROOT / "book" / "_static", source / "_static")
    shutil.copy(build.ROOT / "book" / "references.bib", source)
    shutil.copy(notebook, source)
    build.copy_configuration(source)
    (source / "conf.py").rename(source / "book_conf.py")
    (source / "conf.py").write_text(CONFIGURATION)
    build.copy_mathjax(source / "_static" / "mathjax")
    return source


@pytest.fixture(scope="module")
def html(run, tmp_path_factory) -> Path:
    """The trial book, rendered with every warning an error."""
    into = tmp_path_factory.mktemp("trial")
    assert build.render(assemble(into / "source", run), into / "html") == 0
    return into / "html"


@pytest.fixture(scope="module")
def chapter(html, context):
    """The chapter in a browser; no test leaves it at another width."""
    with watched_page(context, html / "10_trial.html") as (page, _):
        yield page


def test_no_page_has_a_trouble(html, context):
    assert {file.name: troubles_of(context, file) for file in html.glob("*.html")} == {
        file.name: [] for file in html.glob("*.html")
    }


def test_chapter_and_sections_have_the_number_of_the_file(chapter):
    heads = chapter.locator("article :is(h1, h2)").all_text_contents()
    assert [re.match(r"[\d.]+", head)[0] for head in heads] == ["10", "10.1", "10.2", "10.3", "10.4"]
    assert chapter.locator(".bd-sidebar-primary .current").first.text_content().strip().startswith("10")


def test_links_have_numbers(chapter):
    words = chapter.locator("article p").all_text_contents()
    text = " ".join(words)
    for said in ("Definition 10.1 and Theorem 10.1", "Example 10.1 has", "Figure 10.1", "Table 10.1",
                 "Section 10.1", "Section 10.2 holds Equation (10.2)", "By Equation (10.1)"):  # fmt: skip
        assert said in text, said
    assert chapter.locator("article figure .caption-number").all_text_contents() == ["Figure 10.1 ", "Table 10.1 "]


def test_chapters_claims_and_glossary_words_are_linked(chapter):
    def links(words):
        return [a.get_attribute("href") for a in chapter.locator("article a", has_text=words).all()]

    assert links("claim 7") == ["ledger.html#claim-7"]
    assert len(links("chapter 10")) == 1
    assert links("empirical measure") == ["glossary.html#term-empirical-measure"]
    assert links("slices") == ["glossary.html#term-slice"]


def test_what_a_reader_need_not_see_is_folded(chapter):
    shown = chapter.locator("div.cell details.hide > summary").all_text_contents()
    lines = [re.search(r"Show [\w: ]+\w", line)[0] for line in shown]
    assert lines == ["Show code: imports", "Show code: drawing", "Show code: checks", "Show the solution"]
    assert chapter.locator("figure img").is_visible()
    assert chapter.get_by_text("def double(x)").first.is_visible()


def test_tables_are_html_with_formulas(chapter):
    table = chapter.locator("#tab-squares table")
    assert table.locator("thead mjx-container").count() == 2
    assert table.locator("tbody th").all_text_contents() == ["row 0", "row 1", "row 2"]


def test_no_table_is_wider_than_the_page(chapter):
    ends = "[...document.querySelectorAll('article table')].map(t => t.getBoundingClientRect().right)"
    for width in (400, 800, 1280):
        set_width(chapter, width)
        chapter.wait_for_function(f"() => Math.max(...{ends}) > 0")  # the page slides in beside its margin
        assert max(chapter.evaluate(ends)) <= width


def test_a_question_is_answered_from_the_keyboard(chapter):
    choices = chapter.locator("input[type=radio]")
    choices.nth(1).focus()
    chapter.keyboard.press("Space")
    assert chapter.locator(".quiz-said").text_content().startswith("✗ Not right. The product")
    assert chapter.locator(".quiz-score").text_content() == "0 of 1 answered right"
    chapter.keyboard.press("ArrowUp")
    assert chapter.locator(".quiz-said").text_content().startswith("✓ Right.")
    assert chapter.locator(".quiz-said a").get_attribute("href") == "#fig-square"


def test_a_link_to_nothing_stops_the_build(run, tmp_path, capfd):
    """One build with every kind of them: each is said."""
    text, lost = run.read_text(encoding="utf-8"), ["there is no chapter 77", "claim-99"]
    links = {"chapter 10": "chapter 77", "claim 7": "claim 99"}
    for kind, name in (("fig", "square"), ("thm", "metric"), ("eq", "wide")):
        links[f"(#{kind}-{name})"] = f"(#{kind}-none)"
        lost.append(f"{kind}-none")
    for link, other in links.items():
        assert link in text
        text = text.replace(link, other, 1)
    notebook = tmp_path / "10_trial.ipynb"
    notebook.write_text(text, encoding="utf-8")
    assert build.render(assemble(tmp_path / "source", notebook), tmp_path / "html") == 1
    said = capfd.readouterr().err
    assert [name for name in lost if name not in said] == []


def test_a_folder_that_can_not_be_written_is_named(run, tmp_path):
    (tmp_path / "doctrees").touch()
    with pytest.raises(OSError, match=re.escape(str(tmp_path / "doctrees"))):
        build.render(assemble(tmp_path / "source", run), tmp_path / "html")


def test_what_an_extension_could_not_write_is_named_and_other_errors_end_with_a_status(monkeypatch, tmp_path, capsys):
    def fail(*arguments, **settings):
        raise ExtensionError("a handler failed") from cause

    monkeypatch.setattr(build, "Sphinx", fail)
    cause = OSError(errno.ENOSPC, "no space")
    with pytest.raises(OSError, match="no space"):
        build._run_sphinx(tmp_path, tmp_path)
    cause = KeyError("a")
    assert build._run_sphinx(tmp_path, tmp_path) == 2
    assert capsys.readouterr().err == "Extension error: a handler failed\n"


ANSWER = {"answer": "a", "because": "b"}


@pytest.mark.parametrize(
    ("quiz", "said"),
    [
        ([], "no list of questions"),
        ([{"question": "?"}], "question 1: the keys"),
        ([{"question": "?", "answers": [ANSWER]}], "1 answers; at least 3"),
        ([{"question": "?", "answers": [ANSWER] * 3}], "0 answers are marked"),
        ([{"question": "?", "answers": [ANSWER | {"right": True}] * 3}], "3 answers are marked"),
        ([{"question": "?", "answers": [ANSWER | {"right": True}, ANSWER, {"answer": "c"}]}], "lacks `answer`"),
    ],
)
def test_a_quiz_that_cannot_be_asked(tmp_path, quiz, said):
    file = tmp_path / "10_trial.yaml"
    file.write_text(str(quiz))
    with pytest.raises(ValueError, match=re.escape(said)):
        read_quiz(file)


def test_text_is_taken_over_and_changed_code_is_not(run, tmp_path):
    for file in run.parent.iterdir():
        shutil.copy(file, tmp_path)
    source = tmp_path / "10_trial.md"
    source.write_text(source.read_text(encoding="utf-8").replace("This chapter shows", "Here is"), encoding="utf-8")
    told = retold_notebook(source)
    assert told.cells[0].source.startswith("# A trial\n\nHere is")
    assert [c.get("outputs") for c in told.cells] == [c.get("outputs") for c in nbformat.read(run, 4).cells]
    source.write_text(source.read_text(encoding="utf-8").replace("== 0", "== 1 - 1"), encoding="utf-8")
    with pytest.raises(ValueError, match="code cell 4 has changed; run it"):
        retold_notebook(source)
