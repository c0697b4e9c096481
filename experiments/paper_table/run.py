"""Check the paper's tables for consistency: inequalities, deviations, cells printed twice, shares as counts."""

import time
from pathlib import Path

import torch
import yaml
from counting import faces_for, factors, smallest_shares
from inequality import CONVENTIONS, broken_rows, direction_allowance, exchanged, rows_of
from oddities import column_pattern, printed_twice, smallest_deviations

from meshot.provenance import rounded, write_results

HERE = Path(__file__).resolve().parent


def main() -> None:
    """Compute everything, in seconds."""
    torch.set_num_threads(1)
    started = time.process_time()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    paper = yaml.safe_load((HERE / config["paper"]).read_text(encoding="utf-8"))
    command, data = "python experiments/paper_table/run.py", "the paper's printed tables"
    results = rounded({"table": table_read(paper, config), "counts": counts_read(paper, config)})
    seconds = time.process_time() - started
    write_results(HERE / "results.json", results, config, command, data, seconds)


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


if __name__ == "__main__":
    main()
