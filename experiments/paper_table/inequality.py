"""Consistency of SW and W in each row: inequalities for the printed means, under each convention of the columns."""

import math

import numpy as np

from meshot.rng import numpy_generator

#: Possible meanings of the columns, and the bound of a row, also for means over scans: SWD ** power <= bound * EMD.
#: With p = 2: SW2^2 <= W2^2 / 3. With p = 1: SW1 <= W1 / 2, the mean of |u_1| over directions. GeomLoss at p = 2
#: returns half of W2^2. A mean of roots is at most the root of the mean, so that the fourth holds for means.
CONVENTIONS = {
    "W2 and SW2, roots taken": {"power": 1, "bound": 1 / math.sqrt(3), "directions": 0.5},
    "W2² and SW2², no roots": {"power": 1, "bound": 1 / 3, "directions": 1},
    "½ W2² and SW2², no roots": {"power": 1, "bound": 2 / 3, "directions": 1},
    "½ W2² and SW2, one root": {"power": 2, "bound": 2 / 3, "directions": 1},
    "√(½ W2²) and SW2": {"power": 1, "bound": math.sqrt(2 / 3), "directions": 0.5},
    "W1 and SW1": {"power": 1, "bound": 1 / 2, "directions": 0.5},
}


def direction_allowance(n_directions: int, n_draws: int, quantile: float, seed: int) -> float:
    """The factor by which SW2² over random directions may exceed W2²/3: 3 times the largest eigenvalue of mean u uᵀ."""
    generator = numpy_generator(seed)
    largest = np.empty(n_draws)
    for i in range(n_draws):
        u = generator.normal(size=(n_directions, 3))
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        largest[i] = 3 * np.linalg.eigvalsh(u.T @ u / n_directions)[-1]
    return float(np.quantile(largest, quantile))


def excess(emd: float, swd: float, convention: dict, allowance: float, rounding: float) -> float:
    """SWD over its largest value in the row. Above 1 the row violates the inequality, with allowance for rounding."""
    bound = convention["bound"] * allowance ** convention["directions"] * (emd + rounding)
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


def broken_rows(rows: list[dict], allowance: float, rounding: float) -> list[dict]:
    """For each convention the number of rows that violate its inequality, and their names."""
    found = []
    for name, convention in CONVENTIONS.items():
        ratios = {label(row): excess(row["emd"], row["swd"], convention, allowance, rounding) for row in rows}
        broken = {key: ratio for key, ratio in ratios.items() if ratio > 1}
        found.append({"convention": name, "n_rows": len(rows), "n_broken": len(broken), "broken": broken})
    return found


def label(row: dict) -> str:
    """The name of a row."""
    return f"{row['table']}, {row['part']}, {row['system']}"
