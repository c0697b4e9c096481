"""Summaries of the benchmarks: growth exponents of time and memory, and the table of targets."""

import math

import numpy as np
import peers

MEGABYTE = 1e6


def exponents(cases: list[dict], memory: list[dict], smallest: int = 10_000) -> list[dict]:
    """For every method and dimension, the slope of log seconds (or bytes) over log m, from ``smallest`` on."""
    rows = []
    for quantity, found in (("seconds", cases), ("bytes", memory)):
        for name in peers.PEERS:
            for d in sorted({row["d"] for row in found}):
                own = [r for r in found if r["peer"] == name and r["d"] == d and r["m"] >= smallest and r.get(quantity)]
                if len({row["m"] for row in own}) > 1:
                    x, y = (np.log([row[key] for row in own]) for key in ("m", quantity))
                    slope = float(np.polyfit(x, y, 1)[0])
                    ends = {"from": own[0]["m"], "to": own[-1]["m"]}
                    rows.append({"peer": name, "d": d, "quantity": quantity, "exponent": slope} | ends)
    return rows


def targets(cases: list[dict], memory: list[dict]) -> list[dict]:
    """Targets, measured values (None if not measured), and whether they are met."""
    seconds = {(row["peer"], row["m"], row["d"]): row["seconds"] for row in cases}
    rows = []

    def aim(what: str, found: float | None, limit: float, at_least: bool = False, unit: str = "×") -> None:
        met = None if found is None else (found >= limit if at_least else found <= limit)
        rows.append({"what": what, "found": found, "limit": limit, "at_least": at_least, "unit": unit, "met": met})

    def ratio(a: str, b: str, m: int, d: int) -> float | None:
        pair = seconds.get((a, m, d)), seconds.get((b, m, d))
        return None if None in pair else pair[0] / pair[1]

    for m, least in ((10_000, 20), (100_000, 30)):
        for d in (3, 6):
            aim(f"times faster than POT, m = {m}, d = {d}", ratio(peers.POT, peers.OURS, m, d), least, True)
    for d, most in ((3, 1.3), (6, 0.35)):
        aim(f"time over k-d-tree Chamfer, m = 100000, d = {d}", ratio(peers.OURS, peers.TREE, 100_000, d), most)
    for d in (3, 6):
        aim(f"time over np.argsort of both sides, m = 100000, d = {d}", ratio(peers.OURS, peers.FLOOR, 100_000, d), 1.5)
    for d in (3, 6):
        aim(f"growth of time from m = 10000 to 1000000, exponent, d = {d}", end_to_end(seconds, d), 1.15, unit="")
    ours = [row["bytes"] for row in memory if row["peer"] == peers.OURS and (row["m"], row["d"]) == (1_000_000, 6)]
    used = ours[0] / MEGABYTE if ours else None
    aim("memory above the inputs, m = 1000000, d = 6", used, 300, unit="MB")
    for name, most in ((peers.VALUE, 0.25), (peers.EXACT, 0.6)):
        aim(f"{name}, 20480 faces each side, d = 3", seconds.get((name, 20_480, 3)), most, unit="s")
    return rows


def end_to_end(seconds: dict, d: int) -> float | None:
    """The growth exponent between two sizes whose ratio is 100."""
    ends = [seconds.get((peers.OURS, m, d)) for m in (10_000, 1_000_000)]
    return None if None in ends else math.log(ends[1] / ends[0]) / math.log(100)
