"""The tables of ``config.yaml`` and its verdicts, from the rows of heads and of pairs.

Run as ``python experiments/new_heads/judging.py``: it makes them anew in ``results.json`` from ``rows.csv`` and
``pairs.csv``, without any measurement. ``run.py`` does the same at its end.
"""

import functools
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import scipy.stats

from meshot.provenance import FIELDS, read_results, rounded, write_results
from meshot_book.measurements import grouped, spread
from meshot_book.statistics import holm_adjusted

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.rows import read_rows
from trials.scanned import INITIAL
from trials.training import arguments, read_config

MEASURES = (
    "assd_mm", "hausdorff90_mm", "beyond_percent", "signed_mm", "normals", "crossing_percent", "exact_sw_mm",
)  # fmt: skip
LARGER = {"normals"}
RIVALS_13 = ("deepcsr", "vox2cortex", "corticalflow", "cortexode", "cortexode_104mm")
RIVALS_25 = ("cortexode", "cortexode_104mm", "cortexode_averaged", "varifold_averaged", "ddot_104mm")
UNITS = {"mm": ("ddot", "cortexode"), "104 mm": ("ddot_104mm", "cortexode_104mm")}
#: The readings of claim 16: DDOT, and CortexODE with the same unit, steps and width.
READINGS = {
    "mm": UNITS["mm"],
    "104 mm": UNITS["104 mm"],
    "mm, nine times the steps": ("ddot/budget: ddot_long", "ddot/budget: cortexode_long"),
    "104 mm, the paper's width": ("ddot/budget: ddot_wide", "ddot/budget: cortexode_wide"),
    "104 mm, last weights": ("ddot/readings: ddot_104mm, last", "ddot/readings: cortexode_104mm, last"),
    "mm, last weights": ("ddot/readings: ddot_20mm, last", "ddot/readings: cortexode, last"),
    "mm, nine times the steps, last weights": ("ddot/budget: ddot_long, last", "ddot/budget: cortexode_long, last"),
    "104 mm, the paper's width, last weights": ("ddot/budget: ddot_wide, last", "ddot/budget: cortexode_wide, last"),
}  # fmt: skip


def named(row: dict) -> dict:
    """A row with the name of its arm in the tables: the arm alone at equal steps."""
    own, last = row["budget"] == "own", ", last" if row["which"] == "last" else ""
    seconds = ", equal seconds" if row["budget"] == "seconds" else ""
    return row | {"name": f"{row['protocol']}: {row['arm']}{last}" if own else f"{row['arm']}{seconds}"}


class Heads:
    """The rows of heads, and the intervals of differences between arms."""

    def __init__(self, rows: list[dict], seeds_of: dict[str, str]):
        self.rows, self.seeds_of = [named(row) for row in rows], seeds_of
        self.there = [row for row in self.rows if not row.get("failed")]
        self.columns = list(dict.fromkeys((row["cohort"], row["side"]) for row in self.rows))

    @functools.cached_property
    def by_arm(self) -> dict[tuple, dict[int, dict[str, dict]]]:
        """The rows of found surfaces by column and arm, by seed, by subject."""
        found: dict[tuple, dict[int, dict[str, dict]]] = {}
        for row in self.there:
            seeds = found.setdefault((row["cohort"], row["side"], row["name"]), {})
            seeds.setdefault(row["seed"] or 0, {})[row["subject"]] = row
        return found

    @functools.cache  # noqa: B019
    def seed_variance(self, name: str, measure: str) -> tuple[float, int]:
        """The variance of the means over subjects between seeds, and its degrees of freedom."""
        if name == INITIAL:
            return 0.0, 1
        squares, freedom = 0.0, 0
        for column in self.columns:
            seeds = self.by_arm.get((*column, name), {})
            if len(seeds) >= 3:
                means = [np.mean([row[measure] for row in those.values()]) for those in seeds.values()]
                squares, freedom = squares + np.var(means, ddof=1) * (len(means) - 1), freedom + len(means) - 1
        if freedom:
            return float(squares / freedom), freedom
        return self.seed_variance(self.seeds_of[name], measure) if name in self.seeds_of else (float("nan"), 1)

    def gap(self, first: str, second: str, column: tuple[str, str], measure: str) -> dict | None:
        """First minus second in one column; None if one of them is missing."""
        arms = [self.by_arm.get((*column, name)) for name in (first, second)]
        if None in arms:
            return None
        values = []
        for seeds in arms:
            subjects = set.intersection(*(set(those) for those in seeds.values()))
            values.append({s: np.mean([those[s][measure] for those in seeds.values()]) for s in subjects})
        shared = sorted(values[0].keys() & values[1].keys())
        if len(shared) < 2:
            return None
        gaps = np.array([values[0][s] - values[1][s] for s in shared])
        parts = [(gaps.var(ddof=1) / len(gaps), len(gaps) - 1)]
        for name, seeds in zip((first, second), arms, strict=True):
            variance, freedom = self.seed_variance(name, measure)
            parts.append((variance / len(seeds), freedom))
        about = {"first": first, "second": second, "column": " ".join(column), "measure": measure, "n": len(gaps)}
        return about | interval(float(gaps.mean()), parts)


def interval(gap: float, parts: list[tuple[float, int]]) -> dict[str, float]:
    """Student's interval of a mean whose variance is a sum of estimates, each with its degrees of freedom."""
    total = sum(variance for variance, _ in parts)
    if total == 0:
        return {"gap": gap, "low": gap, "high": gap, "p": float(gap == 0)}
    freedom = total**2 / sum(variance**2 / n for variance, n in parts)
    half = float(scipy.stats.t.ppf(0.975, freedom)) * total**0.5
    p = 2 * float(scipy.stats.t.sf(abs(gap) / total**0.5, freedom))
    return {"gap": gap, "low": gap - half, "high": gap + half, "p": p}


def decided(gaps: list[dict | None]) -> list[dict]:
    """Differences with what is decided after Holm's adjustment over all of them."""
    there = [gap for gap in gaps if gap is not None]
    found = []
    for gap, adjusted in zip(there, holm_adjusted([gap["p"] for gap in there]).tolist(), strict=True):
        better = (gap["gap"] > 0) == (gap["measure"] in LARGER)
        what = ("better" if better else "worse") if adjusted < 0.05 else "undecided"
        found.append(gap | {"adjusted_p": adjusted, "first_is": what, "detectable": (gap["high"] - gap["low"]) / 2})
    return found


def counts(gaps: Iterable[dict]) -> dict[str, int]:
    """How often the first is better, worse, undecided."""
    told = [gap["first_is"] for gap in gaps]
    return {what: told.count(what) for what in ("better", "worse", "undecided")}


def claim_13(heads: Heads) -> dict:
    """DDOT is best in Table 1, in either unit; and the initial surface by the same rule."""
    measures, found = ("assd_mm", "exact_sw_mm"), {}
    for unit, (ours, _) in UNITS.items():
        found[unit] = decided(
            [heads.gap(ours, rival, c, m) for rival in (*RIVALS_13, INITIAL) for c in heads.columns for m in measures]
        )
    start = decided([heads.gap(INITIAL, rival, c, m) for rival in RIVALS_13 for c in heads.columns for m in measures])
    wanted = len(heads.columns) * len(measures) * (len(RIVALS_13) + 1)
    won = [unit for unit, gaps in found.items() if counts(gaps)["better"] == wanted]
    partly = [unit for unit, gaps in found.items() if counts(gaps)["better"] and not counts(gaps)["worse"]]
    verdict = "reproduced" if won else "in part" if partly else "not reproduced at this budget"
    told = {unit: counts(g for g in gaps if g["second"] != INITIAL) for unit, gaps in found.items()}
    return {"verdict": verdict, "counts": told, "counts_of_initial": counts(start), "gaps": found, "initial": start}


def claim_16(heads: Heads) -> dict:
    """Less than 1e-4 % of faces cross, and at most a tenth of CortexODE's."""
    found = []
    for reading, pair in READINGS.items():
        for column in heads.columns:
            arms = [heads.by_arm.get((*column, name)) for name in pair]
            if None not in arms:
                ours, other = (
                    float(np.mean([row["crossing_percent"] for those in seeds.values() for row in those.values()]))
                    for seeds in arms
                )
                about = {"reading": reading, "column": " ".join(column), "percent": ours, "cortexode_percent": other}
                found.append(about | {"small": ours < 1e-4, "tenth": ours <= other / 10})
    small, both = (
        [row for row in found if f(row)] for f in (lambda r: r["small"], lambda r: r["small"] and r["tenth"])
    )
    verdict = "depends on a choice left open" if small else "not reproduced"
    return {"verdict": "reproduced" if found and len(both) == len(found) else verdict, "readings": found}


def claim_17(heads: Heads) -> dict:
    """The sliced loss against the Chamfer distance, by unit."""
    measures = ("assd_mm", "exact_sw_mm", "normals", "crossing_percent")
    gaps = decided([heads.gap(*pair, c, m) for pair in UNITS.values() for c in heads.columns for m in measures])
    told = {unit: counts(gap for gap in gaps if gap["first"] == pair[0]) for unit, pair in UNITS.items()}
    verdicts = {unit: "reproduced" if n["better"] and not n["worse"] else "not reproduced" for unit, n in told.items()}
    return {"verdicts": verdicts, "counts": told, "gaps": gaps}


def claim_19(pairs: list[dict]) -> dict:
    """Consistency: DDOT against every rival of claim 13, by person; and the initial surface by the same rule."""
    people: dict[str, dict[str, dict]] = {}
    for part in grouped([named(row) for row in pairs if not row.get("failed")], ("arm", "subject")):
        if len(part) == 2:
            values = {measure: float(np.mean([row[measure] for row in part])) for measure in MEASURES}
            people.setdefault(part[0]["name"], {})[part[0]["subject"]] = values

    def gap(first: str, second: str, measure: str) -> dict | None:
        own, other = people.get(first, {}), people.get(second, {})
        gaps = np.array([own[p][measure] - other[p][measure] for p in own if p in other])
        about = {"first": first, "second": second, "measure": measure, "n": len(gaps)}
        parts = [(gaps.var(ddof=1) / len(gaps), len(gaps) - 1)] if len(gaps) > 1 else None
        return about | interval(float(gaps.mean()), parts) if parts else None

    measures = ("assd_mm", "exact_sw_mm")
    found = {
        ours: decided([gap(ours, rival, m) for rival in RIVALS_13 for m in measures])
        for ours in ("ddot", "ddot_104mm", INITIAL)
    }
    told = {ours: counts(gaps) for ours, gaps in found.items()}
    wanted = len(RIVALS_13) * len(measures)
    own = [told[ours] for ours in ("ddot", "ddot_104mm")]
    partly = any(n["better"] and not n["worse"] for n in own)
    verdict = (
        "reproduced"
        if any(n["better"] == wanted for n in own)
        else "in part"
        if partly
        else "not reproduced at this budget"
    )
    return {"verdict": verdict, "n_people": len(people.get(INITIAL, {})), "counts": told, "gaps": found}


def claim_25(heads: Heads, ours: str) -> dict:
    """A local loss against five rivals in six measures."""
    measures = tuple(measure for measure in MEASURES if measure != "signed_mm")
    gaps = decided([heads.gap(ours, rival, c, m) for rival in RIVALS_25 for c in heads.columns for m in measures])
    table = {
        rival: {m: counts(g for g in gaps if (g["second"], g["measure"]) == (rival, m)) for m in measures}
        for rival in RIVALS_25
    }
    beaten = {rival: [m for m, n in by.items() if n["better"] and not n["worse"]] for rival, by in table.items()}
    lost = {rival: [m for m, n in by.items() if n["worse"]] for rival, by in table.items()}
    whole = all(len(those) == len(measures) for those in beaten.values())
    fails = any(len(lost[rival]) > len(beaten[rival]) for rival in RIVALS_25)
    verdict = "holds" if whole else "fails" if fails else "in part"
    return {"verdict": verdict, "beaten": beaten, "lost": lost, "table": table, "gaps": gaps}


def judged(rows: list[dict], pairs: list[dict], config: dict) -> dict:
    """All tables and verdicts."""
    heads = Heads(rows, config["seeds_of"])
    table = []
    for part in grouped(heads.rows, ("cohort", "side", "name", "seed")):
        there = [row for row in part if not row.get("failed")]
        about = {key: part[0][key] for key in ("cohort", "side", "name", "seed")}
        about |= {"n_subjects": len(there), "n_failed": len(part) - len(there)}
        table.append(about | {key: spread([row[key] for row in there]) for key in MEASURES})
    claims = {"13": claim_13(heads), "16": claim_16(heads), "17": claim_17(heads), "19": claim_19(pairs)}
    claims |= {"25": claim_25(heads, "local"), "25, 104 mm": claim_25(heads, "local_104mm")}
    return {"table": table, "claims": claims}


def main(words: list[str] | None = None) -> int:
    """Make tables and verdicts anew."""
    asked = arguments(__doc__, Path(__file__).parent, "results.json").parse_args(words)
    record, config = read_results(asked.output), read_config(asked.config)
    rows, pairs = (read_rows(asked.output.with_name(name)) for name in ("rows.csv", "pairs.csv"))
    made = {name: value for name, value in record.items() if name not in FIELDS[:5]}
    results = rounded(record["results"] | judged(rows, pairs, config))
    write_results(asked.output, results, config, record["command"], record["data"], record["seconds"], made)
    return 0


if __name__ == "__main__":
    sys.exit(main())
