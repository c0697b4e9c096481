"""Claims 13 and 19: the systems of Table 1 on held-out subjects, and of Table 2 on two scans of one subject.

The protocol in the configuration of ``experiments/comparison`` states what each status needs. "Better" means that the
95 % interval of the paired difference (Student) excludes zero.
"""

from collections.abc import Iterable

from meshot_book.claims.ledger import AT_THIS_BUDGET, IN_PART, NOT_TESTED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

INITIAL, PERFECT, STEPS, SECONDS = "initial", "perfect", "steps", "seconds"
DISTANCES = {"emd_mm": "EMD (mm)", "swd_mm": "SWD (mm)", "assd_mm": "ASSD (mm)"}
SHOWN = DISTANCES | {"normals": "normals", "crossing_percent": "crossing (%)"}
RESIDUES = {"icp_residue_mm": "residue of ICP (mm)", "rigid_residue_mm": "error of its motion (mm)"}
CLAIMED_PAIRS = ("emd_mm", "assd_mm")  # the paper itself has FreeSurfer better in SWD


def systems_verdict(record: dict) -> Verdict:
    """Claim 13 from ``experiments/comparison``: is DDOT better than the four other systems of the paper's Table 1?

    A cell is a distance (EMD, SWD, ASSD) of a rival on one side of one cohort, at equal steps.
    """
    results, plan = record["results"], record["config"]["comparison"]
    cells = [cell for cell in results["claims"]["best"] if cell["budget"] == STEPS]
    won, lost, n_cells = _count(cells, "ours"), _count(cells, "other"), len(plan["rivals"]) * len(cells)
    nearer = [row["assd_mm"] for row in results["claims"]["against_initial"]]
    missing = _listed_arms([arm for cell in cells for arm in cell["missing"]], record)
    agrees = _seconds_agree(results, plan) and _seeds_agree(results, plan)
    status = NOT_TESTED if missing or not cells else _systems_status(won, lost, n_cells, nearer, agrees)
    farther = nearer.count("other")
    in_swd = [g["swd_mm"]["better"] for g in results["differences"] if g["second"] == INITIAL]
    return Verdict(
        status=status,
        says=(
            f"At a small budget, DDOT is better than another system of the paper in {won} of {n_cells} comparisons and "
            f"worse in {lost} (EMD: {_counts(cells, 'emd_mm', ', ')}). In ASSD it ends farther from the truth "
            f"than the initial surface in {farther} of {len(nearer)} columns, and in SWD nearer in "
            f"{in_swd.count('ours')} of {len(in_swd)}."
            if not missing
            else f"Not all systems are measured in every column yet: {missing}."
        ),
        headline=(f"{won} of {n_cells}", "comparisons with another system in which DDOT is nearer"),
        ours=_systems_sentence(record, cells),
        tolerance=(
            "reproduced if DDOT is better than each of the four other systems of the paper in EMD, SWD and ASSD, in "
            "all four columns, and the table at equal seconds and the three seeds agree in sign; in part if this holds "
            "in some columns or distances and no other system is better anywhere; not reproduced at this budget "
            "otherwise, and if DDOT is not better in ASSD than the initial surface in every column. Better: the 95 % "
            "interval of the difference over subjects (Student) excludes zero"
        ),
        numbers=f"{_table_1(record)}\n\n{_gaps(record)}",
    )


def _systems_status(won: int, lost: int, n_cells: int, nearer: list[str], agrees: bool) -> str:
    if set(nearer) != {"ours"} or lost or not won:
        return AT_THIS_BUDGET
    return REPRODUCED if won == n_cells and agrees else IN_PART


def _count(cells: Iterable[dict], who: str) -> int:
    return sum(len(cell[who]) for cell in cells)


def _counts(cells: list[dict], metric: str, between: str) -> str:
    """How often our system is better in a distance, and how often worse."""
    own = [cell for cell in cells if cell["metric"] == metric]
    return f"{_count(own, 'ours')}{between}{_count(own, 'other')}"


def _seconds_agree(results: dict, plan: dict) -> bool:
    """Whether the distances of every rival at equal seconds are larger in the mean than those of our system."""
    gaps = [gap for gap in results["differences"] if gap["budget"] == SECONDS and gap["second"] in plan["rivals"]]
    return bool(gaps) and all(gap[metric]["gap"] < 0 for gap in gaps for metric in DISTANCES)


def _seeds_agree(results: dict, plan: dict) -> bool:
    """Whether each seed of our system has smaller mean distances than the same seed of every rival.

    A system that finds both sides with one network has seeds on both. The side without seeds of our system is left out.
    """
    lines = {(line["arm"], line["cohort"], line["side"]): line for line in results["seeds"] if line["budget"] == STEPS}
    columns = [column for arm, *column in lines if arm == plan["ours"]]
    if not columns or any((arm, *column) not in lines for arm in plan["rivals"] for column in columns):
        return False
    return all(
        mine < theirs
        for column in columns
        for arm in plan["rivals"]
        for metric in DISTANCES
        for mine, theirs in zip(
            lines[plan["ours"], *column][metric]["means"], lines[arm, *column][metric]["means"], strict=True
        )
    )


def consistency_verdict(record: dict) -> Verdict:
    """Claim 19 from ``experiments/comparison``: do two scans of one subject agree best with DDOT, after ICP?"""
    results, plan = record["results"], record["config"]["comparison"]
    found = {cell["metric"]: cell for cell in results["claims"]["consistency"]}
    claimed = [found[metric] for metric in CLAIMED_PAIRS if metric in found]
    won, lost, n_cells = _count(claimed, "ours"), _count(claimed, "other"), len(plan["rivals"]) * len(CLAIMED_PAIRS)
    missing = _listed_arms([arm for cell in claimed for arm in cell["missing"]], record)
    status = AT_THIS_BUDGET if lost or not won else (REPRODUCED if won == n_cells else IN_PART)
    return Verdict(
        status=NOT_TESTED if missing or not claimed else status,
        says=(
            f"On {results['n_pairs']} pairs of scans, DDOT agrees with itself better than another system in {won} of "
            f"{n_cells} comparisons in EMD and ASSD, and worse in {lost}."
            if not missing
            else f"Not all systems are measured on the pairs yet: {missing}."
        ),
        headline=(f"{won} of {n_cells}", "comparisons with another system in which DDOT is more consistent"),
        ours=_consistency_sentence(record, found),
        tolerance=(
            "reproduced if DDOT is better than each of the other four systems of the paper in EMD and ASSD; in part if "
            "it is better than some and none is better; not reproduced at this budget otherwise. Better: the 95 % "
            "interval of the paired difference over pairs of scans (Student) excludes zero. Pairs of one subject are "
            "not independent. FreeSurfer's row is played by a classical system, which is not FreeSurfer"
        ),
        numbers=_table_2(record),
    )


def names_of(config: dict) -> dict[str, str]:
    """The title of every row of the tables by its name in the results."""
    titles = {arm: entry["title"] for arm, entry in config["arms"].items()}
    return titles | {INITIAL: "initial surface", PERFECT: "floor: a perfect surface"}


def _listed_arms(arms: list[str], record: dict) -> str:
    return ", ".join(names_of(record["config"])[arm] for arm in dict.fromkeys(arms))


def _systems_sentence(record: dict, cells: list[dict]) -> str:
    """For every rival the number of cells won and lost, and for every column the ASSD of all systems."""
    names, results, plan = names_of(record["config"]), record["results"], record["config"]["comparison"]
    each = [
        f"{names[arm]} {sum(arm in cell['ours'] for cell in cells)} : {sum(arm in cell['other'] for cell in cells)}"
        for arm in plan["rivals"]
    ]
    n_points = record["config"]["evaluation"]["n_emd_points"]
    by_metric = ", ".join(f"{title.split()[0]} {_counts(cells, key, ' : ')}" for key, title in DISTANCES.items())
    shown = (INITIAL, plan["ours"], *plan["rivals"], *plan["also"])
    near = []
    for column in columns_of(results):
        means = {line["arm"]: line["assd_mm"]["mean"] for line in lines_of(results, column)}
        near.append(f"{named(column)}: " + ", ".join(f"{names[a]} {digits(means[a], 3)}" for a in shown if a in means))
    return (
        f"better : worse, over {len(cells)} pairs of a column and a distance, {names[plan['ours']]} against "
        f"{', '.join(each)}. The same by distance: {by_metric}. EMD has {n_points} points, and most of its "
        f"value is its floor (chapter 38). ASSD in mm: {'; '.join(near)}"
    )


def _consistency_sentence(record: dict, found: dict[str, dict]) -> str:
    names, rows = names_of(record["config"]), {row["arm"]: row for row in record["results"]["table_2"]}
    each = [
        f"{title.split()[0]}: better than {_listed_arms(found[metric]['ours'], record) or 'none'}, worse than "
        f"{_listed_arms(found[metric]['other'], record) or 'none'}"
        for metric, title in DISTANCES.items()
        if metric in found
    ]
    values = [
        f"{names[arm]} {digits(row['emd_mm']['mean'], 3)} | {digits(row['assd_mm']['mean'], 3)}"
        for arm, row in rows.items()
        if row["emd_mm"]["mean"] is not None
    ]
    return f"{'; '.join(each)}. EMD | ASSD in mm: {', '.join(values)}"


def columns_of(results: dict) -> list[tuple[str, str]]:
    """The columns of Table 1: cohort and side."""
    return list(dict.fromkeys((line["cohort"], line["side"]) for line in results["table_1"]))


def named(column: tuple[str, str]) -> str:
    """A column in words."""
    return f"{column[0].replace('_', ' ')}, {column[1]}"


def lines_of(results: dict, column: tuple[str, str], budget: str = STEPS) -> list[dict]:
    """The rows of a column, for the subjects of the training kind: initial surface, floor, and systems at a budget."""
    return [
        line
        for line in results["table_1"]
        if (line["cohort"], line["side"], line["kind"]) == (*column, "template") and line["budget"] in (None, budget)
    ]


def spread(found: dict) -> str:
    """Mean ± standard deviation."""
    if found["mean"] is None:
        return "–"
    return digits(found["mean"], 3) + (f" ± {digits(found['sd'], 2)}" if found["sd"] is not None else "")


def _table_1(record: dict) -> str:
    names = names_of(record["config"])
    return markdown_table(
        [
            {"column": named(column), "surface": names[line["arm"]]}
            | {title: spread(line[metric]) for metric, title in SHOWN.items()}
            | {"subjects": line["n_subjects"], "not found": line["n_failed"]}
            for column in columns_of(record["results"])
            for line in lines_of(record["results"], column)
        ]
    )


def _gaps(record: dict) -> str:
    names = names_of(record["config"])
    return markdown_table(
        [
            {"column": named((gap["cohort"], gap["side"])), "DDOT minus": names[gap["second"]]}
            | {"budget": f"equal {gap['budget']}" if gap["budget"] else "–"}
            | {f"{title} [95 %]": interval(gap[metric]) for metric, title in DISTANCES.items()}
            for gap in record["results"]["differences"]
        ]
    )


def interval(found: dict) -> str:
    """A difference with its interval."""
    return f"{found['gap']:+.3g} [{found['low']:+.3g}, {found['high']:+.3g}]"


def _table_2(record: dict) -> str:
    names = names_of(record["config"])
    return markdown_table(
        [
            {"surface": names[row["arm"]]}
            | {title: spread(row[metric]) for metric, title in (DISTANCES | RESIDUES).items()}
            | {"pairs": row["n_pairs"]}
            for row in record["results"]["table_2"]
        ]
    )
