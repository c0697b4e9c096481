"""Inconsistent numbers in the tables: deviations, and cells that are printed twice."""

import itertools


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
