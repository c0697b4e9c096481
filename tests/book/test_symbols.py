"""The symbols of every chapter stand in ``book/symbols.yaml``, and none has two meanings within a part."""

import re

import pytest
import yaml

import symbols_extension as symbols
from plain import source_notebook


@pytest.fixture(scope="module")
def listed(request) -> symbols.Table:
    return symbols.read_table(request.config.rootpath / "book" / "symbols.yaml")


def prose(path) -> str:
    """The text of a chapter, and its quiz as one more section."""
    quiz = yaml.safe_load((path.parent.parent / "book" / "quizzes" / f"{path.stem}.yaml").read_text(encoding="utf-8"))
    asked = [each["question"] for each in quiz]
    asked += [answer[key] for each in quiz for answer in each["answers"] for key in ("answer", "because")]
    cells = [cell.source for cell in source_notebook(path).cells if cell.cell_type == "markdown"]
    return "\n\n".join([*cells, "## Quiz", *map(str, asked)])


def pytest_generate_tests(metafunc):
    if "chapter" in metafunc.fixturenames:
        paths = sorted((metafunc.config.rootpath / "notebooks").glob("[0-9][0-9]_*.md"))
        metafunc.parametrize("chapter", paths, ids=lambda path: path.stem)


def test_every_symbol_of_a_chapter_is_listed_and_every_line_used(listed, chapter):
    if chapter.stem[:2] not in listed.unlisted:
        assert listed.faults(chapter.stem[:2], prose(chapter)) == []


def test_no_symbol_has_two_meanings_within_a_part(listed):
    assert listed.doubles() == []


def test_every_chapter_is_in_one_part(listed, root):
    chapters = sorted(path.stem[:2] for path in (root / "notebooks").glob("[0-9]*.md"))
    found = [chapter for part in listed.parts for chapter in part.chapters]
    assert sorted([*found, *listed.unlisted]) == chapters


TABLE = r"""
everywhere:
  - {symbol: 'x, y', meaning: positions}
parts:
  - title: One
    chapters: ['01', '02']
    symbols:
      - {symbol: 'a', meaning: a mass, chapters: ['01', '02']}
      - {symbol: '\sigma, \sigma_b', meaning: two deviations, chapters: {'\sigma': ['01'], '\sigma_b': ['02']}}
    local:
      '01': [{symbol: 't', meaning: a time, in: [Late]}]
"""
CHAPTER = "# A\n\n$a\\,x_i + \\sigma$\n\n## Early\n\nText.\n\n## Late\n\n$\\frac{t}{2}$ and `$q$`\n"


def table(text: str = TABLE) -> symbols.Table:
    return symbols.Table.of(yaml.safe_load(text))


def test_a_chapter_that_keeps_to_its_table_has_no_fault():
    assert table().faults("01", CHAPTER) == []
    assert table().doubles() == []


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (("$a\\,x", "$a\\,q\\,x"), "q is not listed"),
        (("Text.", "$t = 1$"), "t is local to Late and stands under Early"),
        (("$\\frac{t}{2}$", "nothing"), "t is listed and not used"),
        (("+ \\sigma$", "+ \\sigma_b$"), "\\sigma_b belongs to chapters 02"),
        (("$a\\,x", "$\\hat a\\,x"), "\\hat{a} is not listed"),
    ],
)
def test_each_fault_of_a_chapter_is_seen(change, fault):
    assert fault in table().faults("01", CHAPTER.replace(*change))


@pytest.mark.parametrize(
    ("old", "new", "double"),
    [
        ("{symbol: 'a',", "{symbol: 'x',", "x: a mass; positions"),
        ("{symbol: 't',", "{symbol: 'a',", "a: a time; a mass"),
        ("'\\sigma, \\sigma_b'", "'a, \\sigma_b'", "a: a mass; two deviations"),
    ],
)
def test_two_meanings_are_seen(old, new, double):
    assert double in table(TABLE.replace(old, new)).doubles()


def test_what_is_read_in_a_formula():
    formula = r"\hat\mu_m \text{ if } \operatorname{Var} x_{i+1} \le \mathcal{L}(\bar{x}) + \frac12 \W_2^2 + \mathrm dz"
    found = [symbol for symbol, _ in symbols.symbols_of(formula)]
    assert found == [r"\hat\mu", "x", r"\mathcalL", r"\bar{x}", r"\W", "z"]
    assert [with_sub for _, with_sub in symbols.symbols_of(r"\sigma_b + K_{p,R} + x_{\mathrm F}")] == [
        r"\sigma_b", "K_p,R", "x_F",
    ]  # fmt: skip


def test_the_page_shows_every_line(listed, root):
    page = (root / "book" / "notation.md").read_text(encoding="utf-8")
    assert re.findall(r"```\{symbol-table\} (.*)", page) == ["everywhere", *(part.title for part in listed.parts)]
    for part in listed.parts:
        rows = listed.rows(part.title)
        assert len(rows) == len(part.symbols) + 2
        assert all(row.count("|") == 5 for row in rows)
    assert all(row.count("|") == 4 for row in listed.rows("everywhere"))
