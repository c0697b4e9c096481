"""Means over seeds, after equal steps and after equal times, and Chamfer minus sliced Wasserstein."""

from collections.abc import Callable

import numpy as np
from fitting import CURVES

from meshot.provenance import rounded
from meshot_book.measurements import grouped
from meshot_book.statistics import arm_differences, short

READ = ("seconds", "iteration", *CURVES)


def summarise(fits: list[dict]) -> list[dict]:
    """Statistics of every arm over the seeds, at its last step and at the time when the fastest arm is finished."""
    rows = []
    for group in grouped(fits, ("target", "start", "loss", "encoding", "supports")):
        kind = {name: group[0][name] for name in ("target", "start", "loss", "encoding", "supports")}
        for at, read in (("steps", at_the_end), ("seconds", lambda fit: at_seconds(fit, shared_seconds(fit, fits)))):
            values = [read(fit) for fit in group]
            rows.append(kind | {"at": at, "n_seeds": len(group)} | _statistics(values))
    return rows


def at_the_end(fit: dict) -> dict[str, float]:
    """All metrics after the last step."""
    return {name: fit["curve"][name][-1] for name in READ} | fit["end"]


def shared_seconds(fit: dict, fits: list[dict]) -> float:
    """The time at which the first arm of the same setting and supports was finished, in s."""
    same = ("target", "start", "seed", "supports")
    return min(other["seconds"] for other in fits if all(other[name] == fit[name] for name in same))


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
    rows = []
    for group in grouped(fits, ("target", "start", "encoding", "supports")):
        sides = {loss: {f["seed"]: f for f in group if f["loss"] == loss} for loss in ("chamfer", "sliced")}
        seeds = sorted(set(sides["chamfer"]) & set(sides["sliced"]))
        pairs = [(sides["chamfer"][seed], sides["sliced"][seed]) for seed in seeds]
        kind = {name: group[0][name] for name in ("target", "start", "encoding", "supports")}
        for at, read in _EQUAL.items() if pairs else ():
            read_pairs = [read(*pair, fits) for pair in pairs]
            rows.append(kind | {"at": at, "n_seeds": len(pairs)} | _paired(read_pairs))
    return rows


def _equal_seconds(one: dict, other: dict, fits: list[dict]) -> tuple[dict, dict]:
    seconds = min(one["seconds"], other["seconds"])
    return at_seconds(one, seconds), at_seconds(other, seconds)


def _equal_closeness(one: dict, other: dict, fits: list[dict]) -> tuple[dict, dict]:
    level = max(min(one["curve"]["assd"]), min(other["curve"]["assd"]))
    return at_closeness(one, level), at_closeness(other, level)


_EQUAL: dict[str, Callable[[dict, dict, list[dict]], tuple[dict, dict]]] = {
    "steps": lambda one, other, fits: (at_the_end(one), at_the_end(other)),
    "seconds": _equal_seconds,
    "closeness": _equal_closeness,
}


def _paired(pairs: list[tuple[dict, dict]]) -> dict:
    chamfer, sliced = ({name: [arm[name] for arm in side] for name in side[0]} for side in zip(*pairs, strict=True))
    gaps, found = rounded(arm_differences(chamfer, sliced)), {}
    for name in chamfer:
        found |= {f"{name}_chamfer": short(np.mean(chamfer[name])), f"{name}_sliced": short(np.mean(sliced[name]))}
        found |= {f"{name}_{end}": gaps[f"{name}_{end}"] for end in ("gap", "low", "high")}
    return found


def _statistics(values: list[dict]) -> dict:
    found: dict = {}
    for name in values[0]:
        numbers = np.array([row[name] for row in values])
        found[f"{name}_mean"] = short(numbers.mean())
        found[f"{name}_sd"] = short(numbers.std(ddof=1)) if len(numbers) > 1 else None
    return found
