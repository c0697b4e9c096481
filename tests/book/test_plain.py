"""The notebooks in plain Markdown: their numbers are those of the pages, and readers see them whole."""

import re
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

import plain
from browser import watched_page
from plain import plain_notebook, source_notebook
from shown_notebooks import jupyter_lab, open_in_lab, page_of, settle, troubles_of

TRIAL = Path(__file__).parent / "trial"
STORED = sorted(plain.CHAPTERS.glob("[0-9]*.ipynb"))
#: Tried in each run of the tests; the others are left to ``make test-all``. It has every kind of box but one.
CHAPTER = next(path for path in STORED if path.stem == "10_beyond_the_theorem")
CHAPTERS = [pytest.param(path, id=path.stem, marks=[] if path == CHAPTER else pytest.mark.thorough) for path in STORED]
NUMBER = r"(?:Section|Figure|Table|Definition|Theorem|Lemma|Proposition|Corollary|Example|Algorithm) \d+\.\d+"


def text_of(notebook: nbformat.NotebookNode) -> str:
    return "\n\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")


def trial(before: str = "# A trial", after: str = "# A trial") -> nbformat.NotebookNode:
    """The plain notebook of the trial chapter, some words of its source changed."""
    notebook = source_notebook(TRIAL / "10_trial.md")
    assert before in text_of(notebook)
    for cell in notebook.cells:
        cell["source"] = cell.source.replace(before, after)
    return plain_notebook(notebook, "10_trial", TRIAL / "quizzes")


Numbers = tuple[dict[str, str], list[str], list[str]]


def numbers_of_page(page: Path) -> Numbers:
    """Of a page: the number of each label, the headings of chapter and sections, and the numbers of equations."""
    article = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser").select_one("article")
    for tag in article.select("a.headerlink"):
        tag.decompose()
    boxes = {tag["id"]: tag.select_one(".caption-number") for tag in article.select("figure[id], .proof[id]")}
    labels = {label: " ".join(number.get_text().split()) for label, number in boxes.items()}
    for section in article.select('section[id^="sec-"]:has(> h2)'):
        labels[section["id"]] = f"Section {section.h2.get_text().split()[0]}"
    headings = [tag.get_text() for tag in article.select("h1, h2")]
    return labels, [_words(heading) for heading in headings], [tag.get_text() for tag in article.select(".eqno")]


def numbers_of_notebook(text: str) -> Numbers:
    """The same of the text of a notebook."""
    labels = dict(re.findall(rf'<a id="([^"]*)"></a>(?:\*Code: |\*\*)({NUMBER})', text))
    sections = re.findall(r'<a id="([^"]*)"></a>\n\n## (\d+\.\d+) ', text)
    labels |= {label: f"Section {number}" for label, number in sections}
    headings = [_words(heading) for heading in re.findall(r"^##? (?!References$)(.*)$", text, re.M)]
    return labels, headings, [f"({number})" for number in re.findall(r"\\tag\{(.*?)\}", text)]


def _words(heading: str) -> str:
    """A heading without formulas, which the page writes in another way."""
    return " ".join(re.findall(r"[\w.]+", re.sub(r"\$.*?\$|\\\(.*?\\\)", "", heading)))


def test_numbers_are_those_of_the_pages(html):
    pages = {path.stem: numbers_of_page(html / f"{path.stem}.html") for path in STORED}
    on_pages = {label: number for labels, _, _ in pages.values() for label, number in labels.items()}
    links = []
    for path in STORED:
        text = text_of(nbformat.read(path, as_version=4))
        assert numbers_of_notebook(text) == pages[path.stem], path.stem
        links += re.findall(rf"\[({NUMBER})\]\([^)#]*#([^)]*)\)", text)
    assert [(words, label) for words, label in links if on_pages[label] != words] == []
    assert len(links) > 300


def test_what_stands_in_the_source_has_its_plain_form():
    notebook = trial()
    text, cells = text_of(notebook), {cell.id: cell for cell in notebook.cells}
    nbformat.validate(notebook)
    for part in (
        '# 10 A trial\n\n*About ',
        '<a id="sec-shown"></a>\n\n## 10.1 What is shown',
        '> <a id="def-sliced"></a>**Definition 10.1 (Sliced distance).**\n>\n> For measures',
        r'> $$ \mathrm{SW}_2^2(\mu, \nu) = \int \mathrm{W}_2^2(\theta_\# \mu, \theta_\# \nu)\, \mathrm d\theta .',
        "> *Proof.* By [Equation (10.1)](#eq-sliced) and",
        "> <a id=\"ex-shift\"></a>**Example 10.1.**\n",
        "[Figure 10.1](#fig-square) and [Table 10.1](#tab-squares) are in [Section 10.1](#sec-shown)",
        "(10_beyond_the_theorem.ipynb)",
        "**Figure 10.1.** The square of a number. It is smallest at zero.",
        "<details>\n<summary>The figure in words</summary>\n\nA parabola that opens upward",
        "\\tag{10.2}\n$$",
        "<details>\n<summary>Hint</summary>\n\nWhat is $x + x$?\n\n</details>",
        "<summary>Answer to question 1</summary>",
        "*The solution*",
    ):  # fmt: skip
        assert part in text, part
    folded = {id_: cell.metadata.jupyter for id_, cell in cells.items() if "jupyter" in cell.metadata}
    assert list(folded.values()) == [*[{"source_hidden": True}] * 3, {"source_hidden": True, "outputs_hidden": True}]


def test_a_citation_is_names_and_year_and_has_its_reference():
    cited = "{cite:p}`le2024ddot,charon2013varifold` and {cite:p}`taubin1995`"
    text = text_of(trial("Write a function.", cited))
    names = "[[Le et al., 2024](#ref-le2024ddot); [Charon and Trouvé, 2013](#ref-charon2013varifold)]"
    assert f"{names} and [[Taubin, 1995](#ref-taubin1995)]" in text
    listed = text.partition("## References\n\n")[2].splitlines()
    assert [line[:19] for line in listed] == ['- <a id="ref-charon', '- <a id="ref-le2024', '- <a id="ref-taubin']
    assert "Nicolas Charon and Alain Trouvé. The varifold representation" in listed[0]


def test_links_lead_to_the_published_book_where_there_is_one(monkeypatch):
    change = ("Write a function.", "Chapters 2 and 3, claim 7, [ledger](ledger.md), [Definition](#def-euler).")
    assert (
        "Chapters [2](02_transport_on_a_line.ipynb) and [3](03_slicing.ipynb), claim 7, ledger, "
        "[Definition 16.1](16_synthetic_cortex.ipynb#def-euler)." in text_of(trial(*change))
    )
    monkeypatch.setattr(plain, "PUBLISHED", "https://example.org/book")
    text = text_of(trial(*change)).replace("https://example.org/book/", "…/")
    assert (
        "Chapters [2](…/02_transport_on_a_line.html) and [3](…/03_slicing.html), [claim 7](…/ledger.html#claim-7), "
        "[ledger](…/ledger.html), [Definition 16.1](…/16_synthetic_cortex.html#def-euler)." in text
    )
    assert "[The page of this chapter](…/10_trial.html)" in text


@pytest.mark.parametrize(
    ("after", "said"),
    [
        (":::{figure} a.png\n:::", "':::{figure} a.png' has no plain form"),
        ("a {kbd}`Enter`", "'{kbd}`Enter`' has no plain form"),
        ("(sec-lost)=\n\nWrite.", "'(sec-lost)=' has no plain form"),
        (r"the macro \SW", r"'\\SW' has no plain form"),
        ("[Table](#tab-none)", "no chapter has the label 'tab-none'"),
        ("in chapter 77", "there is no chapter 77"),
        ("in mm$^2$", "$^2$ touches a word"),
    ],
)
def test_what_has_no_plain_form_is_named(after, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        trial("Write a function.", after)


@pytest.fixture(scope="module")
def lab(context):
    """A page of a browser, and the address of a JupyterLab that shows the notebooks."""
    with jupyter_lab(plain.CHAPTERS) as address:
        page = context.browser.new_page()
        yield page, address
        page.close()


@pytest.mark.parametrize("path", CHAPTERS)
def test_jupyter_lab_shows_it_whole(path, lab):
    page, address = lab
    open_in_lab(page, address, path)
    assert page.locator("mjx-container").count() > 10
    assert troubles_of(page) == []
    if path == CHAPTER:
        place = page.locator("[data-jupyter-id=fig-curse]")
        assert place.bounding_box()["y"] > 2000
        page.locator("a[href='#fig-curse']").first.click()
        page.wait_for_timeout(500)
        assert 0 < place.bounding_box()["y"] < 720


@pytest.mark.parametrize("path", CHAPTERS)
def test_nbconvert_shows_it_whole(path, context, tmp_path_factory):
    with watched_page(context, page_of(path, tmp_path_factory.getbasetemp())) as (page, troubles):
        settle(page)
        assert page.locator("mjx-container").count() > 10
        assert [*troubles, *troubles_of(page)] == []


CELL = '<div class="jp-Cell"><div class="jp-RenderedMarkdown">{}</div></div>'


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        (":::{quiz}", "raw :::"),
        ("by {cite:p}<code>le2024</code>", "raw {cite:p}"),
        ("costs $x$", "raw $"),
        ("a **bold", "raw **"),
        ("<a href='#a' id='a'>Table</a>", "no number"),
        ("<a href='#b'>Table 1.1</a>", "no place: #b"),
        ("<img src='data:,'>", "no words"),
        ("<mjx-container><i style='color: red'>\\W</i></mjx-container>", "formula: \\W"),
    ],
)
def test_each_trouble_of_a_notebook_is_seen(text, seen, tmp_path, context):
    file = tmp_path / "page.html"
    file.write_text(f"<!doctype html><meta charset=utf-8>{CELL.format(text)}", encoding="utf-8")
    with watched_page(context, file) as (page, _):
        (trouble,) = troubles_of(page)
    assert trouble.startswith(seen)
