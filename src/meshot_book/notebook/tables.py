"""Tables as HTML in a browser and as aligned text in a terminal, with numbers in a few significant digits."""

import dataclasses
import html
import math
import re

from markupsafe import Markup

from meshot.view import filled

_MATHEMATICS = re.compile(r"\$([^$]+)\$")
_UNIT = re.compile(r"(.+?)\s+(\([^()]+\))")
_POWER = re.compile(r"([\d.]+)e(−?)\+?0*(\d+)")
_INDENT = re.compile(r"\n +")
_MISSING = ("", "–")


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """Rows as a table, with the keys of the first row as column heads.

    A notebook shows it as HTML; ``str`` and ``print`` give aligned text. Mathematics in heads and cells is written
    between dollars. A unit in parentheses at the end of a head is shown on a line of its own.

    Parameters
    ----------
    rows : list of dict
        One mapping per row, from head to value.
    n_digits : int
        Significant digits of floats.
    """

    rows: list[dict]
    n_digits: int = 4

    @property
    def heads(self) -> list[str]:
        """The heads of the columns."""
        return list(self.rows[0]) if self.rows else []

    def __str__(self) -> str:
        """Aligned text, with numbers aligned on the right."""
        if not self.rows:
            return "(no rows)"
        lines = [[_MATHEMATICS.sub(r"\1", text) for text in line] for line in [self.heads, *self._cells()]]
        widths = [max(map(len, column)) for column in zip(*lines)]
        numeric = [self._is_numeric(head) for head in self.heads]
        return "\n".join(
            "  ".join(
                text.rjust(width) if right else text.ljust(width) for text, width, right in zip(line, widths, numeric)
            ).rstrip()
            for line in lines
        )

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """An HTML table whose first column contains the row heads."""
        kinds = ["number" if self._is_numeric(head) else "words" for head in self.heads]
        heads = [(_head(head), kind) for head, kind in zip(self.heads, kinds)]
        rows = [[(_shown(text, kind), kind) for text, kind in zip(cells, kinds)] for cells in self._cells()]
        return _INDENT.sub("\n", filled("meshot_book/notebook/assets/table.html", heads=heads, rows=rows))

    def _cells(self) -> list[list[str]]:
        return [[self._text(row.get(head, "")) for head in self.heads] for row in self.rows]

    def _text(self, value: object) -> str:
        return digits(value, self.n_digits) if isinstance(value, float) else str(value)

    def _is_numeric(self, head: str) -> bool:
        values = [row.get(head, "") for row in self.rows]
        return all(isinstance(value, int | float) or value in _MISSING for value in values)


def table(rows: list[dict], n_digits: int = 4) -> Table:
    """Rows as a :class:`Table`, with floats in ``n_digits`` significant digits and columns as in the first row.

    Examples
    --------
    >>> table([{"loss": "Chamfer", "$W_2$ (mm)": 0.47123}, {"loss": "SW", "$W_2$ (mm)": 12}])
    loss     W_2 (mm)
    Chamfer    0.4712
    SW             12
    """
    return Table(rows, n_digits)


def markdown_table(rows: list[dict], n_digits: int = 4) -> str:
    """Rows as a Markdown table, with floats in ``n_digits`` significant digits and columns as in the first row.

    Examples
    --------
    >>> print(markdown_table([{"loss": "Chamfer", "ratio": 0.5}]))
    | loss | ratio |
    | --- | --- |
    | Chamfer | 0.5 |
    """
    shown = Table(rows, n_digits)
    lines = [shown.heads, ["---"] * len(shown.heads), *shown._cells()]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _head(text: str) -> Markup:
    """A column head, with its unit below."""
    found = _UNIT.fullmatch(text)
    return Markup(f'{_rich(found[1])} <span class="unit">{_rich(found[2])}</span>' if found else _rich(text))


def _shown(text: str, kind: str) -> Markup:
    return Markup(_number(text) if kind == "number" else _rich(text))


def _number(text: str) -> str:
    """A number for HTML: with a minus sign, and a power of ten instead of an e."""
    return _POWER.sub(r"\1·10<sup>\2\3</sup>", text.replace("-", "−")) if text != "nan" else "–"


def _rich(text: str) -> str:
    """Escaped text with mathematics in the form that MathJax and Jupyter expect."""
    return _MATHEMATICS.sub(r"\\(\1\\)", html.escape(text, quote=False))


# Formatting of numbers: four significant digits, so that stored outputs agree between CPUs.


def digits(value: float, n_digits: int = 4) -> str:
    """A number with ``n_digits`` significant digits, never as minus zero."""
    value = float(value)
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{n_digits}g}"
    return "0" if float(text) == 0 else text
