"""Claims 13 and 17: trained flows on held-out subjects, DDOT beside CortexODE and beside other losses and encodings."""

from meshot_book.claims.ledger import CONDITION, NOT_REPRODUCED, NOT_TESTED, Verdict
from meshot_book.notebook import digits, markdown_table

OURS, RIVAL, INITIAL = "ddot", "cortexode", "initial"
DISTANCES = ("emd_mm", "swd_mm", "assd_mm")
#: The columns of the paper's Table 1; crossing faces are counted as the flow leaves them, before they are settled.
METRICS = {
    "emd_mm": "EMD, mm", "swd_mm": "SWD, mm", "assd_mm": "ASSD, mm", "normals": "Chamfer normals",
    "flow_crossing_percent": "crossing faces, %",
}  # fmt: skip
LARGER_IS_BETTER = ("normals",)
LOSSES_ALLOWED = 1 / 20  # CortexODE leads in one of the twenty cells of the paper
#: What Table 3 puts beside DDOT: the encoding or the loss exchanged, one at a time.
EXCHANGED = {
    "sliced_samples": "samples for the varifold", "chamfer_varifold": "Chamfer for sliced Wasserstein",
    "sinkhorn_varifold": "Sinkhorn, on 500 faces, for sliced Wasserstein",
}  # fmt: skip
ARMS = {
    OURS: "sliced, varifold (DDOT)", "sliced_samples": "sliced, samples",
    "sliced_surface": "sliced, continuous surface", RIVAL: "Chamfer, samples (CortexODE)",
    "chamfer_varifold": "Chamfer, varifold", "sinkhorn_samples": "Sinkhorn, 500 samples",
    "sinkhorn_varifold": "Sinkhorn, varifold of 500", "windowed": "sliced in windows, varifold",
}  # fmt: skip


def systems_verdict(record: dict) -> Verdict:
    """Claim 13 from ``experiments/ddot``: DDOT against CortexODE, with all but the loss alike.

    A cell is a metric on one side of one cohort. It goes to the one that the interval over subjects favours, and, where
    several seeds were trained, that over seeds as well. Three of the five systems are not compared, so that the claim
    can at best hold with a condition.
    """
    results = record["results"]
    columns = [row for row in _against(results, RIVAL) if row["side"] != "both"]
    cells = [_favours(row, metric, results["seeds"]) for row in columns for metric in METRICS]
    won, lost = cells.count(OURS), cells.count(RIVAL)
    nearer = all(OURS in [_favours(row, m, results["seeds"]) for m in DISTANCES] for row in columns)
    status = CONDITION if nearer and lost <= LOSSES_ALLOWED * len(cells) else NOT_REPRODUCED
    return Verdict(
        status=status if columns else NOT_TESTED,
        ours=_systems_sentence(results, columns, won, lost, len(cells)) if columns else "no fair pair is trained yet",
        tolerance=(
            "with a condition (that CortexODE is the only rival: same network, initial surfaces, data and steps) if "
            "CortexODE is better in at most one of twenty cells, as in the paper, and DDOT in at least one distance of "
            "every column. Better: the 95 % interval of the difference over subjects (bootstrap) excludes zero, and "
            "where there are several seeds that over seeds (Student) does so on the same side. Not reproduced otherwise"
        ),
        numbers=_systems_table(results, columns) if columns else "",
    )


def ablation_verdict(record: dict) -> Verdict:
    """Claim 17 from ``experiments/ddot``: is DDOT better than with another encoding, or another loss?

    One seed each, so that the claim can at best hold with a condition.
    """
    results, rule = record["results"], _ABLATION_RULE
    grid = _grid(results)
    favours = {arm: _favoured(grid[arm]) for arm in EXCHANGED if arm in grid}
    missing = [ARMS[arm] for arm in EXCHANGED if arm not in grid]
    holds = all(OURS in found and arm not in found for arm, found in favours.items())
    if not favours:
        return Verdict(NOT_TESTED, f"not trained yet: {_listed(missing)}", rule)
    status = NOT_REPRODUCED if not holds else NOT_TESTED if missing else CONDITION
    return Verdict(status, _ablation_sentence(results, grid, missing), rule, _ablation_table(results, grid))


_ABLATION_RULE = (
    "with a condition (one seed, one hemisphere, Sinkhorn on 500 faces, and of what the paper leaves out of its table "
    "nothing counts) if against each of the three exchanges that the paper tabulates DDOT is better in at least one of "
    "EMD, SWD and ASSD and worse in none. Better: the 95 % interval of the difference over subjects (bootstrap) "
    "excludes zero. Not reproduced otherwise, for which one exchange is enough; not yet tested while those that are "
    "trained leave it open"
)


def _against(results: dict, arm: str) -> list[dict]:
    """DDOT minus another arm, wherever both were trained."""
    return [row for row in results["differences"] if (row["first"], row["second"]) == (OURS, arm)]


def _grid(results: dict) -> dict[str, dict]:
    """By arm, DDOT minus it, on the side of the cohort where most arms were trained."""
    columns: dict[tuple[str, str], dict[str, dict]] = {}
    for row in results["differences"]:
        if row["first"] == OURS and row["second"] != INITIAL and row["side"] != "both":
            columns.setdefault((row["cohort"], row["side"]), {})[row["second"]] = row
    return max(columns.values(), key=len, default={})


def _favours(row: dict, metric: str, seeds: list[dict]) -> str | None:
    """Which arm is better, if the intervals over subjects and over seeds, where there are any, agree on one."""
    found = {_side_of_zero(row[metric])}
    found |= {_side_of_zero(s[metric]) for s in seeds if (s["cohort"], s["side"]) == (row["cohort"], row["side"])}
    if len(found) > 1 or found == {0}:
        return None
    return row["first"] if (found == {1}) == (metric in LARGER_IS_BETTER) else row["second"]


def _side_of_zero(interval: dict) -> int:
    return (interval["low"] > 0) - (interval["high"] < 0)


def _systems_sentence(results: dict, columns: list[dict], won: int, lost: int, n_cells: int) -> str:
    """Who is better how often, in what, and how near both come."""
    by_metric = []
    for metric, name in METRICS.items():
        found = [_favours(row, metric, results["seeds"]) for row in columns]
        by_metric.append(f"{name.split(',')[0]} {found.count(OURS)} : {found.count(RIVAL)}")
    near = "; ".join(
        f"{_name(row)}: {_mean(results, row, OURS)} against {_mean(results, row, RIVAL)}, initially "
        f"{_mean(results, row, INITIAL)}"
        for row in columns
    )
    return (
        f"against CortexODE alone, in {len(columns)} of 4 columns: DDOT is better in {won} of {n_cells} cells, "
        f"CortexODE in {lost}, the rest is undecided ({', '.join(by_metric)}). ASSD in mm: {near}. Three of the five "
        "systems are not compared here"
    )


def _ablation_sentence(results: dict, grid: dict[str, dict], missing: list[str]) -> str:
    place = next(iter(grid.values()))
    parts = [f"{name}: {_compared(grid[arm])}" for arm, name in EXCHANGED.items() if arm in grid]
    parts += [f"not trained yet: {_listed(missing)}"] if missing else []
    beside = [f"{ARMS[arm]}: {_compared(grid[arm])}" for arm in ARMS if arm in grid and arm not in EXCHANGED]
    untabulated = f". Not in the paper's table: {'; '.join(beside)}" if beside else ""
    return (
        f"{_name(place)}, DDOT with one thing exchanged. {'; '.join(parts)}{untabulated}. ASSD in mm: DDOT "
        f"{_mean(results, place, OURS)}, initially {_mean(results, place, INITIAL)}"
    )


def _favoured(row: dict) -> list[str | None]:
    return [_favours(row, metric, []) for metric in DISTANCES]


def _compared(row: dict) -> str:
    """In which distances the second arm of a difference is worse than DDOT, and in which better."""
    found = {METRICS[m].split(",")[0]: arm for m, arm in zip(DISTANCES, _favoured(row), strict=True)}
    worse = [name for name, arm in found.items() if arm == OURS]
    better = [name for name, arm in found.items() if arm == row["second"]]
    return f"worse in {_listed(worse)}, better in {_listed(better)}"


def _listed(words: list[str]) -> str:
    return "; ".join(words) if any("," in word for word in words) else ", ".join(words) or "nothing"


def _systems_table(results: dict, columns: list[dict]) -> str:
    rows = []
    for column in columns:
        (over_seeds,) = [s for s in results["seeds"] if _same_place(s, column)] or [None]
        for metric, name in METRICS.items():
            rows.append(
                {"column": _name(column), "metric": name}
                | {title: _spread(results, column, arm, metric) for arm, title in _TITLES.items()}
                | {"DDOT − CortexODE [95 %], subjects": _interval(column[metric])}
                | {"seeds": _interval(over_seeds[metric]) if over_seeds else "–"}
            )
    return markdown_table(rows)


_TITLES = {INITIAL: "initial surface", RIVAL: "CortexODE", OURS: "DDOT"}


def _ablation_table(results: dict, grid: dict[str, dict]) -> str:
    place, rows = next(iter(grid.values())), []
    for arm in (INITIAL, *ARMS):
        if arm in (INITIAL, OURS, *grid):
            cells = {"loss, encoding": "initial surface" if arm == INITIAL else ARMS[arm]}
            for metric, name in METRICS.items():
                cells[name] = _spread(results, place, arm, metric)
            for metric in DISTANCES:
                title = f"DDOT minus this, {METRICS[metric]} [95 %]"
                cells[title] = _interval(grid[arm][metric]) if arm in grid else "–"
            rows.append(cells)
    return markdown_table(rows)


def _same_place(one: dict, other: dict) -> bool:
    return (one["cohort"], one["side"]) == (other["cohort"], other["side"])


def _of(results: dict, place: dict, arm: str) -> dict:
    """The summary of an arm at the first seed, on subjects of the kind that trainings know."""
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


def _interval(found: dict) -> str:
    return f"{found['gap']:+.3g} [{found['low']:+.3g}, {found['high']:+.3g}]"


def _name(row: dict) -> str:
    return f"{row['cohort'].replace('_', ' ')}, {row['side']}"
