"""Formatting of numbers: four significant digits, so that stored outputs agree between CPUs."""

import math


def digits(value: float, n_digits: int = 4) -> str:
    """A number with ``n_digits`` significant digits, never as minus zero."""
    value = float(value)
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{n_digits}g}"
    return "0" if float(text) == 0 else text
