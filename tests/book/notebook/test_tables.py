"""Tables: the same numbers as text and as HTML, with units, mathematics and nothing that a browser would run."""

import html.parser

import pytest

from meshot_book.notebook.tables import markdown_table, table

ROWS = [{"loss": "Chamfer", "$W_2$ (mm)": 0.47123}, {"loss": "SW", "$W_2$ (mm)": 12.0}]


class Reader(html.parser.HTMLParser):
    """The tags, and the text of every cell, as Python's own parser reads them."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.cells = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_data(self, data):
        if self.cells and data.strip():
            self.cells[-1] += data


def cells(rows, n_digits=4):
    return Reader(table(rows, n_digits)._repr_html_()).cells


def test_text_aligns():
    assert str(table(ROWS)) == "loss     W_2 (mm)\nChamfer    0.4712\nSW             12"
    assert repr(table(ROWS)) == str(table(ROWS))
    assert str(table([])) == "(no rows)"


def test_html_holds_the_same_cells():
    assert cells(ROWS) == ["loss", r"\(W_2\) (mm)", "Chamfer", "0.4712", "SW", "12"]
    assert cells([]) == []


def test_heads_are_heads_and_units_have_a_line():
    shown = table(ROWS)._repr_html_()
    assert shown.count('scope="col"') == 2
    assert shown.count('scope="row"') == 2
    assert '<span class="unit">(mm)</span>' in shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [(-0.5, "−0.5"), (1.25e-7, "1.25·10−7"), (-3e12, "−3·1012"), (float("nan"), "–"), (7, "7"), (True, "True")],
)
def test_numbers_are_set(value, shown):
    assert cells([{"a": "x", "b": value}])[-1] == shown


def test_a_gap_leaves_a_column_numeric():
    shown = table([{"a": "x", "b": 1.0}, {"a": "y", "b": "–"}, {"a": "z"}])._repr_html_()
    assert shown.count('<td class="number">') == 3
    assert table([{"a": "x", "b": 1.0}, {"a": "y", "b": "ten"}])._repr_html_().count('<td class="words">') == 2


def test_words_are_escaped():
    shown = table([{"<script>": "a < b & c", "x": "$a < b$"}])._repr_html_()
    assert Reader(shown).tags == ["table", "thead", "tr", "th", "th", "tbody", "tr", "th", "td"]
    assert cells([{"<script>": "a < b & c", "x": "$a < b$"}]) == ["<script>", "x", "a < b & c", r"\(a < b\)"]


def test_a_markdown_table_has_a_rule_and_four_digits():
    assert markdown_table([{"m": 10, "error": 1 / 3}, {"m": 20}]).splitlines() == [
        "| m | error |", "| --- | --- |", "| 10 | 0.3333 |", "| 20 |  |",
    ]  # fmt: skip
