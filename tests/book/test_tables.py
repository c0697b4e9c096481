"""Tables on a narrow screen: what is shown instead of a table that does not fit, and that nothing of it is lost."""

import pytest

import build
from browser import set_width, sideways, watched_page

STATIC = build.ROOT / "book" / "_static"
#: Every cell that a reader sees, by table and row; heads that a block repeats do not count.
SEEN = """() => [...document.querySelectorAll('table')].filter((table) => table.checkVisibility()).map((table) =>
  [...table.rows].map((row) => [...row.cells].map((cell) => cell.innerText.trim())))"""
KINDS = """() => [...document.querySelectorAll('table')].filter((table) => table.checkVisibility())
  .map((table) => table.classList[1])"""


def write_page(folder, heads, rows):
    """A page with one table, and with the style and the scripts of the book."""
    kinds = ["words" if isinstance(value, str) else "number" for value in rows[0]]
    lines = [("th", heads), *(("td", row) for row in rows)]
    cells = ["".join(f'<{tag} class="{kind}">{value}</{tag}>' for value, kind in zip(row, kinds)) for tag, row in lines]
    text = f"<thead><tr>{cells[0]}</tr></thead><tbody>" + "".join(f"<tr>{row}</tr>" for row in cells[1:]) + "</tbody>"
    look = f'<link rel="stylesheet" href="{(STATIC / "tables.css").as_uri()}">'
    # Letters of three fifths of the size, in whichever font a machine has for this.
    look += "<style>body { font-family: monospace; font-size-adjust: ch-width 0.602 }</style>"
    scripts = "".join(f'<script src="{(STATIC / n).as_uri()}"></script>' for n in ("table_layouts.js", "tables.js"))
    page = folder / "page.html"
    page.write_text(
        f'<!doctype html><meta charset="utf-8">{look}{scripts}'
        f'<article class="bd-article"><div><table class="book-table">{text}</table></div></article>'
    )
    return page


WIDE = ["loss", *(f"measurement{i}" for i in range(8))]


def test_a_wide_table_is_shown_in_parts_that_repeat_its_first_column(tmp_path, context):
    rows = [[f"loss {k}", *(10 * k + i / 10 for i in range(8))] for k in range(1, 6)]
    with watched_page(context, write_page(tmp_path, WIDE, rows)) as (page, _):
        assert page.evaluate(KINDS) == [None]
        set_width(page, 400)
        parts = page.evaluate(SEEN)
        assert set(page.evaluate(KINDS)) == {"part"}
        assert 2 <= len(parts) <= 4
        assert all([line[0] for line in part] == ["loss", *(row[0] for row in rows)] for part in parts)
        joined = [[cell for part in parts for cell in part[k][1:]] for k in range(6)]
        assert joined == [WIDE[1:], *([str(value) for value in row[1:]] for row in rows)]
        assert sideways(page) == []
        set_width(page, 1280)
        assert [len(part[0]) for part in page.evaluate(SEEN)] == [9]


def test_a_table_of_few_rows_is_turned(tmp_path, context):
    with watched_page(context, write_page(tmp_path, WIDE, [["Chamfer", *range(8)], ["sliced", *range(8)]])) as (
        page,
        _,
    ):
        set_width(page, 400)
        (seen,) = page.evaluate(SEEN)
        assert seen == [["loss", "Chamfer", "sliced"], *([head, str(i), str(i)] for i, head in enumerate(WIDE[1:]))]
        assert page.evaluate("() => document.querySelectorAll('.turned th[scope=row]').length") == 8


def test_rows_with_the_same_first_columns_become_groups(tmp_path, context):
    heads = ["column", "d", "surface", *WIDE[1:4]]
    rows = [[place, d, name, 1.5, 2.5, 3.5] for place in ("left side", "right side") for d in (3, 6) for name in "abc"]
    with watched_page(context, write_page(tmp_path, heads, rows)) as (page, _):
        set_width(page, 400)
        seen = page.evaluate(SEEN)
        titles = [line[0] for line in seen[0] if len(line) == 1]
        assert titles == ["left side, d = 3", "left side, d = 6", "right side, d = 3", "right side, d = 6"]
        assert [line[0] for line in seen[0]][:5] == ["surface", titles[0], "a", "b", "c"]
        assert sideways(page) == []


def test_rows_in_mixed_order_are_not_grouped(tmp_path, context):
    heads = ["setting", "surface", *WIDE[1:6]]
    rows = [[f"setting {i % 2}", f"surface {i // 2}", 1, 2, 3, 4, 5] for i in range(6)]
    with watched_page(context, write_page(tmp_path, heads, rows)) as (page, _):
        set_width(page, 400)
        assert [line[0] for line in page.evaluate(SEEN)[0]] == ["setting", *(row[0] for row in rows)]


@pytest.mark.parametrize(
    ("heads", "row"),
    [
        (["method", "what it does", "name"], ["a", "a sentence of many words " * 4, "x" * 50]),
        (["method", "x" * 80], ["a", "y" * 80]),
    ],
)
def test_sentences_and_long_words_get_a_block_for_each_row(tmp_path, context, heads, row):
    with watched_page(context, write_page(tmp_path, heads, [row] * 4)) as (page, _):
        set_width(page, 400)
        assert page.evaluate(KINDS) == ["stacked"]
        assert sideways(page) == []
