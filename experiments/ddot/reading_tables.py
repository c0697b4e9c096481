"""Tables of a protocol of readings: means, paired differences over held-out subjects, and which losses help."""

from collections.abc import Iterable

import numpy as np
from measuring import METRICS
from reading_rows import START, WHICH

from meshot.statistics import paired_interval

MAIN = "template"  # the kind of the training subjects; procedural subjects are reported apart
LOSSES = ("loss_before", "loss_after")
COMPARED = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm", "normals", "crossing_percent")


def tables(rows: list[dict], readings: dict[str, dict], rival: str) -> dict:
    """Means, differences, and for every reading whether its loss helps, and whether it beats its rival.

    ``rival`` is the rival of readings that name none.
    """
    rivals = {name: each.get("rival", rival) for name, each in readings.items()}
    held_out = [row for row in rows if (row["split"], row["kind"]) == ("test", MAIN)]
    gaps = differences(held_out, rivals)
    found = decided(gaps, {(row["arm"], row["weights"]) for row in held_out if "failed" in row})
    return {"means": [_mean(part) for part in _grouped(rows)], "differences": gaps, "decided": found}


def _grouped(rows: list[dict]) -> list[list[dict]]:
    found: dict[tuple, list[dict]] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in _PLACE), []).append(row)
    return list(found.values())


_PLACE = ("start", "arm", "weights", "split", "kind")


def _mean(rows: list[dict]) -> dict:
    there = [row for row in rows if "failed" not in row]
    about = {key: rows[0][key] for key in _PLACE} | {"n_subjects": len(there), "n_failed": len(rows) - len(there)}
    names = [key for key in (*METRICS, *LOSSES) if there and key in there[0]]
    return about | {key: _spread([row[key] for row in there]) for key in names}


def _spread(values: list[float]) -> dict[str, float | None]:
    return {"mean": float(np.mean(values)), "sd": float(np.std(values, ddof=1)) if len(values) > 1 else None}


def differences(rows: list[dict], rivals: dict[str, str]) -> list[dict]:
    """Every reading minus its start, and minus its rival with the same kind of weights, paired over subjects."""
    by_arm: dict[tuple, dict[str, dict]] = {}
    for row in rows:
        if "failed" not in row:
            by_arm.setdefault((row["start"], row["arm"], row["weights"]), {})[row["subject"]] = row
    found = []
    for (start, arm, which), own in by_arm.items():
        others = {START: by_arm.get((start, START, None), {})} if arm != START else {}
        if rivals.get(arm, arm) != arm:
            others[rivals[arm]] = next(
                (those for (_, name, weights), those in by_arm.items() if (name, weights) == (rivals[arm], which)), {}
            )
        about = {"start": start, "first": arm, "weights": which}
        found += [about | {"second": name} | gap for name, those in others.items() if (gap := _gap(own, those))]
    return found


def _gap(own: dict[str, dict], other: dict[str, dict], metrics: Iterable[str] = COMPARED) -> dict:
    shared = [subject for subject in own if subject in other]
    if len(shared) < 2:
        return {}
    found: dict = {"n_subjects": len(shared)}
    for metric in metrics:
        gap, low, high = paired_interval([own[s][metric] for s in shared], [other[s][metric] for s in shared])
        found[metric] = {"gap": gap, "low": low, "high": high}
    return found


def decided(gaps: list[dict], failed: set[tuple]) -> dict[str, dict[str, dict[str, bool]]]:
    """For every reading and kind of weights: ``helps`` if it is nearer than its start, ``beats`` if than its rival.

    Nearer: the interval of the difference in ASSD lies below zero, and the flow did not fail on any subject. ``failed``
    contains the readings and the kinds of weights whose flow failed on one.
    """
    found: dict[str, dict[str, dict[str, bool]]] = {}
    for gap in gaps:
        name = "helps" if gap["second"] == START else "beats"
        own = found.setdefault(gap["first"], {which: {} for which in WHICH})
        own[gap["weights"]][name] = (gap["first"], gap["weights"]) not in failed and gap["assd_mm"]["high"] < 0
    return found
