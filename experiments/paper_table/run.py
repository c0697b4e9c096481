"""Check the paper's tables for consistency: inequalities, deviations, cells printed twice, shares as counts."""

import itertools
import math
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import yaml

from meshot.provenance import rounded
from meshot.rng import numpy_generator

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def smallest_shares(face_counts: list[int], bound: float, n_scans: int) -> list[dict]:
    """The share in per cent of two faces, the smallest possible number, and the number that the bound allows."""
    rows = []
    for n_faces in face_counts:
        allowed = bound / 100 * n_faces
        # Strictly below, and exact: 1e-4 / 100 * 100_000 * 80 / 2 is 3.9999999999999996 in floating point.
        pairs = math.ceil(Fraction(str(bound)) * n_faces * n_scans / 200) - 1
        rows.append(
            {
                "n_faces": n_faces,
                "smallest_nonzero_percent": 200 / n_faces,
                "faces_below_bound": allowed,
                "pairs_below_bound_over_scans": pairs,
                "smallest_nonzero_mean_percent": 200 / n_faces / n_scans,
            }
        )
    return rows


def faces_for(bound: float) -> float:
    """The number of faces from which a single intersecting pair is below the bound (in per cent)."""
    return 200 / bound


def factors(paper: dict, n_faces: int) -> list[dict]:
    """CortexODE's share divided by the bound, for each column, and its share as a number of faces."""
    rows = []
    for cohort, sides in paper["table_1"].items():
        for side, systems in sides.items():
            share = systems["CortexODE"][4][0]
            rows.append(
                {
                    "column": f"{cohort} {side}",
                    "cortexode_percent": share,
                    "cortexode_faces": share / 100 * n_faces,
                    "factor": share / paper["si_bound"],
                }
            )
    return rows


#: Possible meanings of the columns, and the bound of a row, also for means over scans: SWD ** power <= bound * EMD.
#: With p = 2: SW2^2 <= W2^2 / 3. With p = 1: SW1 <= W1 / 2, the mean of |u_1| over directions. GeomLoss at p = 2
#: returns half of W2^2. A mean of roots is at most the root of the mean, so that the fourth holds for means. S is a
#: debiased Sinkhorn divergence, which the paper uses and which is smaller than W2^2: see :func:`divergence_factor`.
CONVENTIONS = {
    "W2 and SW2, roots taken": {"power": 1, "bound": 1 / math.sqrt(3), "directions": 0.5},
    "W2² and SW2², no roots": {"power": 1, "bound": 1 / 3, "directions": 1},
    "½ W2² and SW2², no roots": {"power": 1, "bound": 2 / 3, "directions": 1},
    "½ W2² and SW2, one root": {"power": 2, "bound": 2 / 3, "directions": 1},
    "√(½ W2²) and SW2": {"power": 1, "bound": math.sqrt(2 / 3), "directions": 0.5},
    "W1 and SW1": {"power": 1, "bound": 1 / 2, "directions": 0.5},
    "√S and SW2, S a Sinkhorn divergence": {"power": 1, "bound": 1 / math.sqrt(3), "directions": 0.5, "blurred": 0.5},
}
#: Meanings without such an inequality: W1 does not bound SW2, unless the diameter of the surfaces is added.
UNRELATED = ("W1 and SW2",)


def divergence(first: float, second: float, blur: float) -> float:
    """The debiased Sinkhorn divergence, per dimension, of two centred isotropic Gaussians (Janati et al. 2020).

    It is for the cost ``|x - y|**2``; the blur is the one of GeomLoss at p = 2.
    """

    def part(a: float, b: float) -> float:
        spread = math.sqrt(4 * a * a * b * b + blur**4)
        return blur**2 * math.log(spread + blur**2) - spread

    return part(first, second) - part(first, first) / 2 - part(second, second) / 2


def divergence_factor(sizes: list[float], largest_blur_mm: float, n_blurs: int) -> float:
    """The largest W2² over the Sinkhorn divergence of two Gaussians of these standard deviations, over the blurs."""
    blurs = np.linspace(0, largest_blur_mm, n_blurs + 1)[1:]
    return max((sizes[0] - sizes[1]) ** 2 / divergence(*sizes, blur) for blur in blurs)


def direction_allowance(n_directions: int, n_draws: int, quantile: float, seed: int) -> float:
    """The factor by which SW2² over random directions may exceed W2²/3: 3 times the largest eigenvalue of mean u uᵀ."""
    generator = numpy_generator(seed)
    largest = np.empty(n_draws)
    for i in range(n_draws):
        u = generator.normal(size=(n_directions, 3))
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        largest[i] = 3 * np.linalg.eigvalsh(u.T @ u / n_directions)[-1]
    return float(np.quantile(largest, quantile))


def excess(emd: float, swd: float, convention: dict, allowance: float, rounding: float, blurred: float = 1.0) -> float:
    """SWD over its largest value in the row. Above 1 the row violates the inequality, with allowance for rounding."""
    bound = convention["bound"] * allowance ** convention["directions"] * (emd + rounding)
    bound *= blurred ** convention.get("blurred", 0)
    return (swd - rounding) ** convention["power"] / bound


def rows_of(paper: dict) -> list[dict]:
    """All rows of the three tables with an EMD and an SWD."""
    rows = []
    for cohort, sides in paper["table_1"].items():
        for side, systems in sides.items():
            rows += [_row("Table 1", f"{cohort} {side}", system, cells) for system, cells in systems.items()]
    rows += [_row("Table 2", "test-retest", system, cells) for system, cells in paper["table_2"].items()]
    for side, systems in paper["table_3"].items():
        rows += [_row("Table 3", f"ADNI {side}", system, cells) for system, cells in systems.items()]
    return rows


def _row(table: str, part: str, system: str, cells: list) -> dict:
    (emd, emd_sd), (swd, swd_sd) = cells[:2]
    return {"table": table, "part": part, "system": system, "emd": emd, "emd_sd": emd_sd, "swd": swd, "swd_sd": swd_sd}


def exchanged(row: dict, part: str) -> dict:
    """The row, with its two columns swapped if it belongs to ``part``."""
    if not row["part"].startswith(part):
        return row
    return row | {"emd": row["swd"], "swd": row["emd"], "emd_sd": row["swd_sd"], "swd_sd": row["emd_sd"]}


def broken_rows(rows: list[dict], allowance: float, rounding: float, blurred: float = 1.0) -> list[dict]:
    """For each convention the number of rows that violate its inequality, and their names."""
    found = []
    for name, convention in CONVENTIONS.items():
        ratios = {label(row): excess(row["emd"], row["swd"], convention, allowance, rounding, blurred) for row in rows}
        broken = {key: ratio for key, ratio in ratios.items() if ratio > 1}
        found.append({"convention": name, "n_rows": len(rows), "n_broken": len(broken), "broken": broken})
    return found


def label(row: dict) -> str:
    """The name of a row."""
    return f"{row['table']}, {row['part']}, {row['system']}"


def smallest_deviations(rows: list[dict]) -> list[dict]:
    """The smallest standard deviation of each column of EMD and SWD, and the next larger one, sorted by their ratio."""
    found = []
    for (table, part), group in itertools.groupby(rows, key=lambda row: (row["table"], row["part"])):
        group = list(group)
        for column in ("emd", "swd"):
            first, second = sorted(group, key=lambda row: row[f"{column}_sd"])[:2]
            sds = first[f"{column}_sd"], second[f"{column}_sd"]
            place = {"table": table, "part": part, "column": column, "system": first["system"]}
            found.append(place | {"sd": sds[0], "next_sd": sds[1], "factor": sds[1] / sds[0]})
    return sorted(found, key=lambda row: -row["factor"])


def printed_twice(paper: dict) -> list[dict]:
    """DDOT on ADNI is in Table 1 and in Table 3: the cells in which the two differ."""
    found = []
    for side in ("left", "right"):
        first, second = paper["table_1"]["ADNI"][side]["DDOT"], paper["table_3"][side]["SWD on varifolds"]
        for column, one, other in zip(("emd", "swd"), first, second):
            for kind, a, b in zip(("mean", "sd"), one, other, strict=True):
                found.append({"cell": f"{column} {side} {kind}", "table_1": a, "table_3": b, "equal": a == b})
    return found


def column_pattern(rows: list[dict]) -> list[dict]:
    """The relation of EMD and SWD in each cohort of Table 1, for means and deviations."""
    found = []
    for cohort in ("ADNI", "OASIS"):
        group = [row for row in rows if row["table"] == "Table 1" and row["part"].startswith(cohort)]
        found.append(
            {
                "cohort": cohort,
                "n_rows": len(group),
                "emd_above_swd": sum(row["emd"] > row["swd"] for row in group),
                "emd_sd_below_swd_sd": sum(row["emd_sd"] < row["swd_sd"] for row in group),
                "exceptions": [f"{r['part']}, {r['system']}" for r in group if r["emd"] <= r["swd"]],
            }
        )
    return found


def table_read(paper: dict, config: dict) -> dict:
    """Claim 14: EMD and SWD."""
    rows, rounding = rows_of(paper), config["rounding"]
    allowance = direction_allowance(paper["n_directions"], **config["allowance"], seed=config["seed"])
    blurred = divergence_factor(**config["sinkhorn"])
    swapped = [exchanged(row, "OASIS") for row in rows]
    return {
        "allowance": allowance,
        "sinkhorn": {key: config["sinkhorn"][key] for key in ("sizes", "largest_blur_mm")} | {"factor": blurred},
        "conventions": list(CONVENTIONS),
        "unrelated": list(UNRELATED),
        "rows": rows,
        "as_printed": broken_rows(rows, allowance, rounding, blurred),
        "oasis_exchanged": broken_rows(swapped, allowance, rounding, blurred),
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
