"""Paired differences over seeds in the number of self-intersecting faces."""

from meshot.statistics import paired_interval


def differences(fits: list[dict]) -> list[dict]:
    """The effect of the loss for each grid spacing, and of the flow for each loss: means with 95 % intervals.

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
    mean, low, high = paired_interval(first, second)
    return {"mean": mean, "low": low, "high": high, "n_seeds": len(first)}
