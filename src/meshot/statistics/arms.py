"""Two arms of an experiment beside each other, measure by measure."""

from collections.abc import Mapping

import numpy as np

from meshot.statistics.intervals import Values, paired_interval


def arm_differences(
    first: Mapping[str, Values], second: Mapping[str, Values], centre: str = "gap"
) -> dict[str, float | None]:
    """First minus second arm for every measure, paired, as entries of a row.

    Parameters
    ----------
    first, second : mapping
        Measure → its values, in the same order of seeds or subjects in both arms.
    centre : str
        What the mean difference is called.

    Returns
    -------
    dict
        ``NAME_gap`` (or another ``centre``), ``NAME_low`` and ``NAME_high``, see
        :func:`meshot.statistics.paired_interval`. A single pair has a difference, but no interval: None.

    Raises
    ------
    ValueError
        If the arms have not the same measures, or as :func:`meshot.statistics.paired_interval`.
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
