"""Comparison of two arms of an experiment, for every measure."""

from collections.abc import Mapping

import numpy as np

from meshot.statistics.intervals import Values, paired_interval


def arm_differences(
    first: Mapping[str, Values], second: Mapping[str, Values], centre: str = "gap"
) -> dict[str, float | None]:
    """The paired difference, first minus second arm, of every measure, as entries of a table row.

    Parameters
    ----------
    first, second : mapping
        The values of every measure, in the same order of seeds or subjects in both arms.
    centre : str
        The suffix for the mean difference.

    Returns
    -------
    dict
        ``NAME_gap`` (or another ``centre``), ``NAME_low`` and ``NAME_high``, see
        :func:`meshot.statistics.paired_interval`. For a single pair, low and high are None.

    Raises
    ------
    ValueError
        If the arms have different measures; otherwise as :func:`meshot.statistics.paired_interval`.
    """
    if set(first) != set(second):
        odd = ", ".join(sorted(set(first) ^ set(second)))
        raise ValueError(f"{odd}: measured in one arm only; give both arms the same measures")
    found: dict[str, float | None] = {}
    for name, values in first.items():
        if len(values) == len(second[name]) == 1:
            gap, low, high = float(np.subtract(values, second[name])[0]), None, None
        else:
            gap, low, high = paired_interval(values, second[name])
        found |= {f"{name}_{centre}": gap, f"{name}_low": low, f"{name}_high": high}
    return found
