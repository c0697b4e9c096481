"""Rows of measured surfaces: grouped by columns, averaged, and compared over pairs."""

import hashlib
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from meshot.metrics import Evaluation
from meshot.statistics import paired_interval

#: The kind of the held-out subjects that are like those of the training; procedural subjects are reported apart.
MAIN = "template"


def grouped(rows: Iterable[dict], keys: Iterable[str]) -> list[list[dict]]:
    """The rows grouped by the values of ``keys``, in order of first occurrence."""
    names, found = tuple(keys), {}
    for row in rows:
        found.setdefault(tuple(row[name] for name in names), []).append(row)
    return list(found.values())


def spread(values: list[float]) -> dict[str, float | None]:
    """Mean and standard deviation, each None if there are too few values."""
    return {
        "mean": float(np.mean(values)) if values else None,
        "sd": float(np.std(values, ddof=1)) if len(values) > 1 else None,
    }


def paired_gaps(
    first: Mapping[Hashable, dict], second: Mapping[Hashable, dict], metrics: Iterable[str]
) -> dict[str, dict[str, float]]:
    """First minus second for every metric, with the 95 % interval of paired differences (Student).

    ``first`` and ``second`` map a subject, or what else forms a pair, to its row. Pairs are the keys of both. If there
    are fewer than two pairs, the result is empty.
    """
    shared = [key for key in first if key in second]
    if len(shared) < 2:
        return {}
    found = {}
    for metric in metrics:
        gap, low, high = paired_interval([first[k][metric] for k in shared], [second[k][metric] for k in shared])
        found[metric] = {"gap": gap, "low": low, "high": high}
    return found


# The metrics that experiments store for a surface, with their units in the names.

#: Names in the results, and in an evaluation.
METRICS = {
    "emd_mm": "emd",
    "swd_mm": "swd",
    "assd_mm": "assd",
    "hausdorff90_mm": "hausdorff",
    "normals": "normals",
    "crossing_faces": "intersecting_faces",
    "crossing_percent": "intersecting_share",
    "euler_number": "euler_number",
}
#: The metrics that two surfaces are compared by.
COMPARED = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm", "normals", "crossing_percent")


def metric_values(evaluation: Evaluation, what: Literal["value", "floor"] = "value") -> dict[str, float]:
    """The values of all metrics, or their floors, by their names in the results."""
    return {key: getattr(getattr(evaluation, name), what) for key, name in METRICS.items()}


# Digests of files, by which a measurement notices that what it depends on has changed.


def digest_of(paths: Iterable[Path]) -> str:
    """Twelve digits that depend on the names and contents of files, in their order."""
    total = hashlib.sha256()
    for path in paths:
        total.update(path.name.encode() + path.read_bytes())
    return total.hexdigest()[:12]
