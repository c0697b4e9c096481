"""Tables 1 and 2 from the rows of subjects and pairs, and what the claims need of them.

Run as ``python experiments/comparison/tables.py``: it makes the tables in ``results.json`` anew from ``subjects.csv``
and ``pairs.csv``, without any measurement. ``run.py`` does the same at its end.
"""

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from measuring import PAIR_METRICS, PERFECT

from meshot.provenance import FIELDS, file_digest, read_results, rounded, write_results
from meshot_book.measurements import COMPARED, MAIN, grouped, paired_gaps, spread

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.rows import read_rows
from trials.scanned import INITIAL
from trials.training import FIRST_SEED, SECONDS, STEPS, arguments, read_config

SUBJECTS, PAIRS = "subjects.csv", "pairs.csv"
#: Metrics of which a larger value is better.
LARGER = {"normals"}
CLAIMED = ("emd_mm", "swd_mm", "assd_mm")
RESIDUES = ("icp_residue_mm", "rigid_residue_mm")
#: The parts of the results that follow from the rows.
TABLES = ("table_1", "differences", "direct", "seeds", "table_2", "pair_differences", "claims")


def tables(subjects: list[dict], pairs: list[dict], config: dict) -> dict:
    """All tables."""
    first = [row for row in subjects if row["seed"] in (None, FIRST_SEED)]
    gaps = differences(first, config["comparison"]["ours"])
    pair_gaps = pair_differences(pairs, config["comparison"]["ours"])
    return {
        "table_1": [_line(part, COLUMN) for part in grouped(first, COLUMN)],
        "differences": gaps,
        "direct": direct(subjects, config["comparison"]["direct"]),
        "seeds": seeds(subjects),
        "table_2": [_pair_line(part) for part in grouped(pairs, ("arm",))],
        "pair_differences": pair_gaps,
        "claims": claims(first, gaps, pair_gaps, config["comparison"]),
    }


COLUMN = ("cohort", "side", "kind", "arm", "budget")


def measured(rows: list[dict]) -> list[dict]:
    """The rows of surfaces that were found."""
    return [row for row in rows if not row.get("failed")]


def _line(rows: list[dict], keys: Iterable[str]) -> dict:
    there = measured(rows)
    about = {key: rows[0][key] for key in keys} | {"n_subjects": len(there), "n_failed": len(rows) - len(there)}
    seconds = [row["cpu_seconds"] for row in there if row.get("cpu_seconds") is not None]
    about |= {key: spread([row[key] for row in there]) for key in COMPARED}
    about["n_subjects_crossing"] = sum(row["crossing_faces"] > 0 for row in there)
    about["n_subjects_no_sphere"] = sum(row["euler_number"] != 2 for row in there)
    return about | {"cpu_seconds": spread(seconds)}


def _gap(ours: dict[object, dict], other: dict[object, dict], metrics: Iterable[str]) -> dict:
    """Ours minus the other, paired, with Student's interval of 95 % for every metric."""
    gaps = paired_gaps(ours, other, metrics)
    if not gaps:
        return {}
    found = {key: gap | {"better": better(gap["low"], gap["high"], key)} for key, gap in gaps.items()}
    return {"n_shared": len(ours.keys() & other.keys())} | found


def better(low: float, high: float, metric: str) -> str:
    """Which of the two is better by the interval of their difference: "ours", "other" or "undecided"."""
    if low <= 0 <= high:
        return "undecided"
    return "ours" if (low > 0) == (metric in LARGER) else "other"


def differences(rows: list[dict], ours: str, own_budget: str | None = STEPS) -> list[dict]:
    """Our system at equal steps minus every other row of a column, paired over the subjects from the template.

    The initial surface has no budget: it is compared in the same way.
    """
    found = []
    for part in grouped([row for row in measured(rows) if row["kind"] == MAIN], ("cohort", "side")):
        by_arm = {
            (line[0]["arm"], line[0]["budget"]): {row["subject"]: row for row in line}
            for line in grouped(part, ("arm", "budget"))
        }
        mine = by_arm.pop((ours, own_budget), {})
        for (arm, budget), other in by_arm.items():
            gap = {} if arm == PERFECT else _gap(mine, other, COMPARED)
            if gap:
                about = {key: part[0][key] for key in ("cohort", "side")}
                found.append(about | {"first": ours, "second": arm, "budget": budget} | gap)
    return found


def direct(rows: list[dict], pairs: list[list[str]]) -> list[dict]:
    """The first system of every pair minus the second, for every column, budget and seed that both have."""
    own = [row for row in measured(rows) if row["kind"] == MAIN and row["seed"] is not None]
    found = []
    for part in grouped(own, ("cohort", "side", "budget", "seed")):
        about = {key: part[0][key] for key in ("cohort", "side", "budget", "seed")}
        by_arm = {line[0]["arm"]: {row["subject"]: row for row in line} for line in grouped(part, ("arm",))}
        for first, second in pairs:
            gap = _gap(by_arm.get(first, {}), by_arm.get(second, {}), COMPARED)
            found += [about | {"first": first, "second": second} | gap] if gap else []
    return found


def seeds(rows: list[dict]) -> list[dict]:
    """The mean over subjects for every seed, for systems with several, and the standard deviation of these means."""
    found = []
    for part in grouped([r for r in measured(rows) if r["kind"] == MAIN and r["seed"] is not None], COLUMN):
        each = grouped(part, ("seed",))
        if len(each) > 1:
            about = {key: part[0][key] for key in COLUMN} | {"seeds": [line[0]["seed"] for line in each]}
            means = {key: [float(np.mean([row[key] for row in line])) for line in each] for key in COMPARED}
            found.append(about | {key: {"means": values} | spread(values) for key, values in means.items()})
    return found


def _by_pair(rows: list[dict]) -> dict[tuple, dict]:
    """The mean of both sides for every pair of scans of which both sides were found."""
    found = {}
    for part in grouped(rows, ("subject", "session")):
        if len(measured(part)) == len(part) == 2:
            keys = (*PAIR_METRICS, *RESIDUES)
            found[part[0]["subject"], part[0]["session"]] = {k: (part[0][k] + part[1][k]) / 2 for k in keys}
    return found


def _pair_line(rows: list[dict]) -> dict:
    pairs = _by_pair(rows)
    n_asked = len(grouped(rows, ("subject", "session")))
    about = {"arm": rows[0]["arm"], "n_pairs": len(pairs), "n_failed": n_asked - len(pairs)}
    return about | {key: spread([pair[key] for pair in pairs.values()]) for key in (*PAIR_METRICS, *RESIDUES)}


def pair_differences(rows: list[dict], ours: str) -> list[dict]:
    """Our system minus every other one, paired over the pairs of scans. Pairs of one subject are not independent."""
    by_arm = {part[0]["arm"]: _by_pair(part) for part in grouped(rows, ("arm",))}
    mine = by_arm.pop(ours, {})
    gaps = {arm: _gap(mine, other, PAIR_METRICS) for arm, other in by_arm.items() if arm != PERFECT}
    return [{"first": ours, "second": arm} | gap for arm, gap in gaps.items() if gap]


def claims(rows: list[dict], gaps: list[dict], pair_gaps: list[dict], comparison: dict) -> dict:
    """What the thresholds of the protocol for claims 13, 16 and 19 ask for."""
    ours, rivals = comparison["ours"], comparison["rivals"]
    columns = list(dict.fromkeys((gap["cohort"], gap["side"]) for gap in gaps))
    best = [
        {"cohort": cohort, "side": side, "budget": budget, "metric": metric}
        | _against([gap for gap in gaps if (gap["cohort"], gap["side"], gap["budget"]) == (cohort, side, budget)],
                   rivals, metric)
        for cohort, side in columns for budget in (STEPS, SECONDS) for metric in CLAIMED
    ]  # fmt: skip
    initial = [gap for gap in gaps if gap["second"] == INITIAL]
    start = [{key: gap[key] for key in ("cohort", "side")} | {"assd_mm": gap["assd_mm"]["better"]} for gap in initial]
    # What would the rule for claim 13 say of the surface that no system has touched?
    untouched = differences(rows, INITIAL, None)
    by_nothing = [
        {"cohort": cohort, "side": side, "metric": metric}
        | _against([gap for gap in untouched if (gap["cohort"], gap["side"], gap["budget"]) == (cohort, side, STEPS)],
                   rivals, metric)
        for cohort, side in columns for metric in CLAIMED
    ]  # fmt: skip
    found = {"best": best, "best_of_initial": by_nothing, "against_initial": start, "crossing": _crossing(rows, ours)}
    return found | {"consistency": [{"metric": m} | _against(pair_gaps, rivals, m) for m in PAIR_METRICS]}


def _against(gaps: list[dict], rivals: list[str], metric: str) -> dict[str, list[str]]:
    """The rivals by who is better; ``missing`` are those that are not measured."""
    by_rival = {gap["second"]: gap[metric]["better"] for gap in gaps}
    names = ("ours", "other", "undecided")
    return {name: [rival for rival in rivals if by_rival.get(rival) == name] for name in names} | {
        "missing": [rival for rival in rivals if rival not in by_rival]
    }


def _crossing(rows: list[dict], ours: str) -> list[dict]:
    found = []
    own = [r for r in measured(rows) if r["kind"] == MAIN and (r["arm"], r["budget"]) == (ours, STEPS)]
    for part in grouped(own, ("cohort", "side")):
        about = {key: part[0][key] for key in ("cohort", "side")} | {"n_subjects": len(part)}
        about["mean_percent"] = float(np.mean([row["crossing_percent"] for row in part]))
        found.append(about | {"n_subjects_crossing": sum(row["crossing_faces"] > 0 for row in part)})
    return found


def rows_beside(output: Path) -> tuple[list[dict], list[dict]]:
    """The rows of subjects and pairs that belong to a file of results."""
    return read_rows(output.with_name(SUBJECTS)), read_rows(output.with_name(PAIRS))


def row_digests(output: Path) -> dict[str, str]:
    """The checksums of the files of rows."""
    return {name: file_digest(output.with_name(name)) for name in (SUBJECTS, PAIRS)}


def main(words: list[str] | None = None) -> int:
    """Make the tables of the results anew."""
    asked = arguments(__doc__, Path(__file__).parent, "results.json").parse_args(words)
    record, config = read_results(asked.output), read_config(asked.config)
    if record["results"]["rows_sha256"] != row_digests(asked.output):
        raise ValueError(f"the rows beside {asked.output} are not those that were measured with it: run run.py again")
    # The group of settings "comparison" is used by the tables only.
    names = [name for name in {**record["config"], **config} if name != "comparison"]
    if other := [name for name in names if record["config"].get(name) != config.get(name)]:
        raise ValueError(
            f"the rows beside {asked.output} were measured with other settings in {', '.join(other)}; tables can be "
            "made anew only if no more than the group comparison has changed: take these groups back, or run run.py "
            "again"
        )
    results = record["results"] | rounded(tables(*rows_beside(asked.output), config))
    made = {name: value for name, value in record.items() if name not in FIELDS[:5]}
    write_results(asked.output, results, config, record["command"], record["data"], record["seconds"], made)
    return 0


if __name__ == "__main__":
    sys.exit(main())
