"""Check the paper's tables for consistency: inequalities, deviations, cells printed twice, shares as counts."""

import sys
from pathlib import Path

import yaml
from counting import faces_for, factors, smallest_shares
from inequality import CONVENTIONS, broken_rows, direction_allowance, exchanged, rows_of
from oddities import column_pattern, printed_twice, smallest_deviations

from meshot.provenance import rounded

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def table_read(paper: dict, config: dict) -> dict:
    """Claim 14: EMD and SWD."""
    rows, rounding = rows_of(paper), config["rounding"]
    allowance = direction_allowance(paper["n_directions"], **config["allowance"], seed=config["seed"])
    swapped = [exchanged(row, "OASIS") for row in rows]
    return {
        "allowance": allowance,
        "conventions": list(CONVENTIONS),
        "rows": rows,
        "as_printed": broken_rows(rows, allowance, rounding),
        "oasis_exchanged": broken_rows(swapped, allowance, rounding),
        "pattern": column_pattern(rows),
        "deviations": smallest_deviations(rows),
        "printed_twice": printed_twice(paper),
    }


def counts_read(paper: dict, config: dict) -> dict:
    """Claim 16: per cent as numbers of faces."""
    n_scans = paper["test_scans"]["ADNI"]
    return {
        "bound_percent": paper["si_bound"],
        "stated_factor": paper["stated_factor"],
        "n_scans": n_scans,
        "typical_faces": config["typical_faces"],
        "shares": smallest_shares(config["face_counts"], paper["si_bound"], n_scans),
        "faces_for_bound": faces_for(paper["si_bound"]),
        "factors": factors(paper, config["typical_faces"]),
    }


def results(rows: list[dict], config: dict) -> dict:
    """Both claims, in seconds: there are no tasks."""
    paper = yaml.safe_load(Path(__file__).with_name(config["paper"]).read_text(encoding="utf-8"))
    return rounded({"table": table_read(paper, config), "counts": counts_read(paper, config)})


if __name__ == "__main__":
    experiment.run(__file__, lambda config: [], lambda task, config: None, results, "the paper's printed tables")
