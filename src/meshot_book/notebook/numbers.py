"""How numbers are printed: four significant digits, so that stored outputs agree between kinds of CPU."""

import math


def digits(value: float, n_digits: int = 4) -> str:
    """A number in ``n_digits`` significant digits, without a trailing minus-zero or platform-dependent tail."""
    value = float(value)
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{n_digits}g}"
    return "0" if float(text) == 0 else text


def table(rows: list[dict], n_digits: int = 4) -> str:
    """Rows as an aligned text table, floats in ``n_digits`` significant digits; the keys of the first row lead."""
    if not rows:
        return "(no rows)"
    names = list(rows[0])
    cells = [[_cell(row.get(name, ""), n_digits) for name in names] for row in rows]
    widths = [max(len(name), *(len(line[i]) for line in cells)) for i, name in enumerate(names)]
    numeric = [all(isinstance(row.get(name, 0), int | float) for row in rows) for name in names]
    lines = [names, *cells]
    return "\n".join(
        "  ".join(
            text.rjust(w) if right else text.ljust(w) for text, w, right in zip(line, widths, numeric, strict=True)
        ).rstrip()
        for line in lines
    )


def markdown_table(rows: list[dict], n_digits: int = 4) -> str:
    """Rows as a Markdown table, floats in ``n_digits`` significant digits; the keys of the first row lead."""
    names = list(rows[0])
    lines = [names, ["---"] * len(names), *([_cell(row.get(name, ""), n_digits) for name in names] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cell(value: object, n_digits: int) -> str:
    return digits(value, n_digits) if isinstance(value, float) else str(value)
