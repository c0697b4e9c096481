"""Means over seeds, after equal steps and after equal times, and Chamfer minus sliced Wasserstein."""

import numpy as np
from fitting import CURVES

from meshot.provenance import rounded
from meshot_book.measurements import grouped
from meshot_book.statistics import arm_differences, short

READ = ("seconds", "iteration", *CURVES)


def summarise(fits: list[dict]) -> list[dict]:
    """Statistics of every arm over the seeds, at its last step and at the time when the fastest arm is finished."""
    rows = []
    place, same = ("target", "start", "loss", "encoding", "supports"), ("target", "start", "seed", "supports")

    def at_shared_seconds(fit: dict) -> dict[str, float]:
        """The curves when the first arm of the same setting and supports was finished."""
        return at_seconds(
            fit, min(other["seconds"] for other in fits if all(other[name] == fit[name] for name in same))
        )

    for group in grouped(fits, place):
        for at, read in (("steps", at_the_end), ("seconds", at_shared_seconds)):
            values = [read(fit) for fit in group]
            row = {name: group[0][name] for name in place} | {"at": at, "n_seeds": len(group)}
            for name in values[0]:
                numbers = np.array([value[name] for value in values])
                row[f"{name}_mean"] = short(numbers.mean())
                row[f"{name}_sd"] = short(numbers.std(ddof=1)) if len(numbers) > 1 else None
            rows.append(row)
    return rows


def at_the_end(fit: dict) -> dict[str, float]:
    """All metrics after the last step."""
    return {name: fit["curve"][name][-1] for name in READ} | fit["end"]


def at_seconds(fit: dict, seconds: float) -> dict[str, float]:
    """The curves at a time, linear between checks."""
    times = fit["curve"]["seconds"]
    return {name: float(np.interp(seconds, times, fit["curve"][name])) for name in READ}


def at_closeness(fit: dict, level: float) -> dict[str, float]:
    """The curves where ASSD first reaches a level, linear between checks."""
    assd = np.array(fit["curve"]["assd"])
    k = int(np.argmax(assd <= level))
    if k == 0:
        return {name: fit["curve"][name][0] for name in READ}
    part = (assd[k - 1] - level) / (assd[k - 1] - assd[k])
    pairs = {name: fit["curve"][name][k - 1 : k + 1] for name in READ}
    return {name: float(before + part * (after - before)) for name, (before, after) in pairs.items()}


def differences(fits: list[dict]) -> list[dict]:
    """Chamfer minus sliced Wasserstein, paired over seeds, at equal steps, equal time and equal closeness."""
    rows, place = [], ("target", "start", "encoding", "supports")
    for group in grouped(fits, place):
        sides = {loss: {f["seed"]: f for f in group if f["loss"] == loss} for loss in ("chamfer", "sliced")}
        seeds = sorted(set(sides["chamfer"]) & set(sides["sliced"]))
        pairs = [(sides["chamfer"][seed], sides["sliced"][seed]) for seed in seeds]
        for at in ("steps", "seconds", "closeness") if pairs else ():
            read_pairs = [_read_equally(at, *pair) for pair in pairs]
            chamfer, sliced = (
                {name: [arm[name] for arm in side] for name in side[0]} for side in zip(*read_pairs, strict=True)
            )
            gaps = rounded(arm_differences(chamfer, sliced))
            row = {name: group[0][name] for name in place} | {"at": at, "n_seeds": len(pairs)}
            for name in chamfer:
                row |= {
                    f"{name}_chamfer": short(np.mean(chamfer[name])),
                    f"{name}_sliced": short(np.mean(sliced[name])),
                }
                row |= {f"{name}_{end}": gaps[f"{name}_{end}"] for end in ("gap", "low", "high")}
            rows.append(row)
    return rows


def _read_equally(at: str, one: dict, other: dict) -> tuple[dict, dict]:
    """Two fits after all steps, at the time of the faster one, or where both have the ASSD of the farther one."""
    if at == "steps":
        return at_the_end(one), at_the_end(other)
    if at == "seconds":
        seconds = min(one["seconds"], other["seconds"])
        return at_seconds(one, seconds), at_seconds(other, seconds)
    level = max(min(one["curve"]["assd"]), min(other["curve"]["assd"]))
    return at_closeness(one, level), at_closeness(other, level)
