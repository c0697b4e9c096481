"""Means, standard deviations and paired intervals over seeds."""

import numpy as np
from descents import gradients_at_start, short

from meshot.provenance import rounded
from meshot_book.statistics import arm_differences

MEASURED = ("sw_surface", "sw_varifold", "assd", "edge_variation")


def summarise(rows: list[dict]) -> dict:
    """Statistics of every setting over seeds, and with minus without areas, each at its best learning rate."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(repr(row["run"]), []).append(row)
    descents = [group[0]["run"] | _statistics(group) for group in groups.values()]
    best: dict[tuple, dict] = {}
    for row in descents:
        key = row["target"], row["encoding"], row["detach_weights"]
        # The best rate is chosen by the run's own loss. A choice by the exact value would favour that encoding.
        own = f"sw_{row['encoding']}_mean"
        if row["n_collapsed"] == 0 and (key not in best or row[own] < best[key][own]):
            best[key] = row
    pairs = [(row, best.get((*key[:2], True))) for key, row in best.items() if not key[2]]
    return {"descents": descents, "differences": [_difference(*pair) for pair in pairs if pair[1]]}


def _statistics(group: list[dict]) -> dict:
    ended = [row["values"] for row in group if not row["values"]["collapsed"]]
    found: dict = {"n_seeds": len(group), "n_collapsed": len(group) - len(ended)}
    for name in MEASURED if len(ended) > 1 else ():
        values = np.array([row[name] for row in ended])
        found[f"{name}_mean"], found[f"{name}_sd"] = short(values.mean()), short(values.std(ddof=1))
        found[f"{name}_seeds"] = values.tolist()
    return found


def _difference(full: dict, stopped: dict) -> dict:
    """Paired over seeds: gradients stopped minus gradients through the areas, with the 95 % interval (Student's t)."""
    found = {"target": full["target"], "encoding": full["encoding"]}
    found |= {"rate_full": full["learning_rate"], "rate_stopped": stopped["learning_rate"]}
    arms = ({name: arm[f"{name}_seeds"] for name in MEASURED} for arm in (stopped, full))
    gaps = rounded(arm_differences(*arms))
    for name in MEASURED:
        found |= {f"{name}_full": full[f"{name}_mean"], f"{name}_stopped": stopped[f"{name}_mean"]}
        found |= {f"{name}_{end}": gaps[f"{name}_{end}"] for end in ("gap", "low", "high")}
    return found | {"n_seeds": full["n_seeds"]}


def gradient_rows(config: dict) -> list[dict]:
    """The two gradients at the start, mean and standard deviation over seeds, for every target and encoding."""
    rows = []
    for target in config["targets"]:
        for encoding in config["encodings"]:
            found = [gradients_at_start(target, encoding, seed, config) for seed in config["seeds"]]
            row = {"target": target, "encoding": encoding, "n_seeds": len(found)}
            for name in found[0]:
                values = np.array([entry[name] for entry in found])
                row[f"{name}_mean"], row[f"{name}_sd"] = short(values.mean()), short(values.std(ddof=1))
            rows.append(row)
    return rows
