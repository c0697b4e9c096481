"""Paired differences over seeds in the number of crossing faces."""

import numpy as np
from scipy import stats


def differences(fits: list[dict]) -> list[dict]:
    """What the loss changes at each fineness, and what the flow changes under each loss, as means with 95 % intervals.

    ``change`` is "loss" (Chamfer minus sliced) or "flow" (free vertices minus the flow of that spacing).
    """
    counts: dict[tuple, list[int]] = {}
    for row in sorted(fits, key=lambda row: row["seed"]):
        key = (row["pair"], row["loss"], row["encoding"], row["spacing"])
        counts.setdefault(key, []).append(row["crossing"])
    found = []
    for (pair, loss, encoding, spacing), crossing in counts.items():
        row = {"pair": pair, "encoding": encoding, "spacing": spacing}
        if loss == "chamfer" and (pair, "sliced", encoding, spacing) in counts:
            rival = counts[pair, "sliced", encoding, spacing]
            found.append({"change": "loss"} | row | paired(crossing, rival))
        if spacing:
            free = counts[pair, loss, encoding, 0.0]
            found.append({"change": "flow", "loss": loss} | row | paired(free, crossing))
    return found


def paired(first: list[int], second: list[int]) -> dict[str, float]:
    """Mean of the differences over seeds and its 95 % interval by Student's t."""
    gaps = np.array(first, dtype=float) - np.array(second, dtype=float)
    half = stats.t.ppf(0.975, len(gaps) - 1) * gaps.std(ddof=1) / np.sqrt(len(gaps))
    mean = float(gaps.mean())
    return {"mean": mean, "low": mean - float(half), "high": mean + float(half), "n_seeds": len(gaps)}
