"""How numbers are printed: four significant digits, so that stored outputs agree between kinds of CPU."""

import math


def digits(value: float, n_digits: int = 4) -> str:
    """A number in ``n_digits`` significant digits, without a trailing minus-zero or platform-dependent tail."""
    value = float(value)
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{n_digits}g}"
    return "0" if float(text) == 0 else text
