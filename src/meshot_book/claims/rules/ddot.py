"""Claim 17: trained flows on held-out subjects: DDOT, and flows with another loss or encoding.

The configuration of the experiment defines DDOT, the names of the others, and the comparisons of the paper's Table 3,
under ``arms`` and ``comparison``.
"""

from meshot_book.claims.ledger import AT_THIS_BUDGET, IN_PART, NOT_TESTED, Verdict
from meshot_book.claims.rules.comparison import interval, named
from meshot_book.notebook import digits, markdown_table

INITIAL = "initial"
DISTANCES = ("emd_mm", "swd_mm", "assd_mm")
#: The columns of the paper's Table 1. Self-intersecting faces are counted after the flow, before the repair.
METRICS = {
    "emd_mm": "EMD, mm", "swd_mm": "SWD, mm", "assd_mm": "ASSD, mm", "normals": "Chamfer normals",
    "flow_crossing_percent": "crossing faces, %",
}  # fmt: skip


def ablation_verdict(record: dict) -> Verdict:
    """Claim 17 from ``experiments/ddot``: is DDOT better than with another encoding, or another loss?

    There is one seed for each, so that the claim is at best reproduced in part.
    """
    results, rule, plan = record["results"], _ABLATION_RULE, record["config"]["comparison"]
    titles, ours = {arm: each["title"] for arm, each in record["config"]["arms"].items()}, plan["ours"]
    grid = _grid(results, ours)
    favours = {arm: _favoured(grid[arm]) for arm in plan["exchanged"] if arm in grid}
    missing = [titles[arm] for arm in plan["exchanged"] if arm not in grid]
    beaten = [arm for arm, found in favours.items() if ours in found and arm not in found]
    headline = (
        f"{len(beaten)} of {len(plan['exchanged'])}",
        "exchanges that make DDOT worse in some distance and better in none",
    )
    if not favours:
        return Verdict(
            NOT_TESTED, "The networks are not trained yet.", headline, f"not trained yet: {_listed(missing)}", rule
        )
    start = _from_start(results, ours, next(iter(grid.values())))
    status = NOT_TESTED if missing else IN_PART
    if len(beaten) < len(favours) or start >= 0:
        status = AT_THIS_BUDGET
    sentence = _ablation_sentence(results, plan, titles, grid, missing)
    says = (
        f"DDOT is better than {len(beaten)} of the {len(favours)} exchanges in the paper's table; it ends "
        f"{_ENDS[start]} the initial surface from which it starts."
    )
    return Verdict(status, says, headline, sentence, rule, _ablation_table(results, plan, titles, grid))


_ENDS = {
    -1: "nearer to the true surface than",
    0: "about as far from the true surface as",
    1: "farther from the true surface than",
}


def _from_start(results: dict, ours: str, place: dict) -> int:
    """1 if DDOT ends farther in ASSD than the initial surface, -1 if nearer, 0 if the interval contains zero."""
    for row in results["differences"]:
        if (row["first"], row["second"]) == (ours, INITIAL) and _same_place(row, place):
            return _side_of_zero(row["assd_mm"])
    return 0


_ABLATION_RULE = (
    "in part (one seed, one hemisphere, Sinkhorn on 500 faces, and losses that the paper does not tabulate "
    "not counted) if "
    "against each of the three exchanges that the paper tabulates DDOT is better in at least one of EMD, SWD and ASSD "
    "and worse in none, and DDOT ends nearer to the truth in ASSD than the initial surface. Better, nearer: the 95 % "
    "interval of the difference over subjects (bootstrap) excludes zero. Not reproduced at this budget otherwise; not "
    "yet tested while the networks trained so far do not decide it"
)


def _grid(results: dict, ours: str) -> dict[str, dict]:
    """The differences between our arm and each other arm, on the cohort and side with most trained arms."""
    columns: dict[tuple[str, str], dict[str, dict]] = {}
    for row in results["differences"]:
        if row["first"] == ours and row["second"] != INITIAL and row["side"] != "both":
            columns.setdefault((row["cohort"], row["side"]), {})[row["second"]] = row
    return max(columns.values(), key=len, default={})


def _side_of_zero(interval: dict) -> int:
    return (interval["low"] > 0) - (interval["high"] < 0)


def _ablation_sentence(
    results: dict, plan: dict, titles: dict[str, str], grid: dict[str, dict], missing: list[str]
) -> str:
    place, name, exchanged = next(iter(grid.values())), plan["names"][plan["ours"]], plan["exchanged"]
    parts = [f"{what}: {_compared(grid[arm])}" for arm, what in exchanged.items() if arm in grid]
    parts += [f"not trained yet: {_listed(missing)}"] if missing else []
    beside = [f"{titles[arm]}: {_compared(grid[arm])}" for arm in titles if arm in grid and arm not in exchanged]
    untabulated = f". Not in the paper's table: {'; '.join(beside)}" if beside else ""
    return (
        f"{_name(place)}, {name} with one thing exchanged. {'; '.join(parts)}{untabulated}. ASSD in mm: {name} "
        f"{_mean(results, place, plan['ours'])}, initially {_mean(results, place, INITIAL)}"
    )


def _favoured(row: dict) -> list[str | None]:
    """For each distance the arm that is better by its interval, or None."""
    return [{-1: row["first"], 1: row["second"], 0: None}[_side_of_zero(row[metric])] for metric in DISTANCES]


def _compared(row: dict) -> str:
    """The distances in which the second arm of a difference is worse than the first, and those where it is better."""
    found = {METRICS[m].split(",")[0]: arm for m, arm in zip(DISTANCES, _favoured(row), strict=True)}
    worse = [name for name, arm in found.items() if arm == row["first"]]
    better = [name for name, arm in found.items() if arm == row["second"]]
    return f"worse in {_listed(worse)}, better in {_listed(better)}"


def _listed(words: list[str]) -> str:
    return "; ".join(words) if any("," in word for word in words) else ", ".join(words) or "nothing"


def _ablation_table(results: dict, plan: dict, titles: dict[str, str], grid: dict[str, dict]) -> str:
    place, rows = next(iter(grid.values())), []
    for arm in (INITIAL, *titles):
        if arm in (INITIAL, plan["ours"], *grid):
            cells = {"loss, encoding": titles.get(arm, "initial surface")}
            for metric, name in METRICS.items():
                cells[name] = _spread(results, place, arm, metric)
            for metric in DISTANCES:
                title = f"{plan['names'][plan['ours']]} minus this, {METRICS[metric]} [95 %]"
                cells[title] = interval(grid[arm][metric]) if arm in grid else "–"
            rows.append(cells)
    return markdown_table(rows)


def _same_place(one: dict, other: dict) -> bool:
    return (one["cohort"], one["side"]) == (other["cohort"], other["side"])


def _of(results: dict, place: dict, arm: str) -> dict:
    """The summary of an arm at the first seed, on subjects of the training kind."""
    (row,) = [
        row for row in results["summary"]
        if _same_place(row, place) and row["arm"] == arm and row["kind"] == "template" and row["seed"] in (None, 0)
    ]  # fmt: skip
    return row


def _mean(results: dict, place: dict, arm: str) -> str:
    return digits(_of(results, place, arm)["assd_mm"]["mean"], 3)


def _spread(results: dict, place: dict, arm: str, metric: str) -> str:
    found = _of(results, place, arm)[metric]
    return f"{digits(found['mean'], 3)} ± {digits(found['sd'], 2)}"


def _name(row: dict) -> str:
    return named((row["cohort"], row["side"]))
