"""Summary over hemispheres: mean and worst values for every cohort and kind of subject."""

import numpy as np

#: Targets for every held-out subject.
LEAST_DICE, LARGEST_ASSD_MM = 0.95, 0.6


def summary(hemispheres: list[dict]) -> list[dict]:
    """One row per cohort and kind. ``all_spheres`` requires that all defect counts are zero and all χ are 2."""
    groups: dict[tuple[str, str], list[dict]] = {}
    for row in hemispheres:
        groups.setdefault((row["subject"].split("/")[0], row["kind"]), []).append(row)
    return [_row(cohort, kind, rows) for (cohort, kind), rows in groups.items()]


def _row(cohort: str, kind: str, rows: list[dict]) -> dict:
    def values(name: str) -> list[float]:
        return [row[name] for row in rows]

    return {
        "cohort": cohort,
        "kind": kind,
        "n_hemispheres": len(rows),
        "median_dice": float(np.median(values("dice"))),
        "least_dice": min(values("dice")),
        "median_assd_mm": float(np.median(values("assd_mm"))),
        "largest_assd_mm": max(values("assd_mm")),
        "median_assd_mm_from_truth": float(np.median([row["from_truth_alone"]["assd_mm"] for row in rows])),
        "all_spheres": all(is_sphere(row) for row in rows),
        "n_self_intersecting": sum(row["self_intersecting_faces"] > 0 for row in rows),
        "n_below_dice": sum(row["dice"] < LEAST_DICE for row in rows),
        "n_above_assd": sum(row["assd_mm"] > LARGEST_ASSD_MM for row in rows),
    }


def is_sphere(row: dict) -> bool:
    """Whether the surface is one closed, manifold component of Euler number 2."""
    counts = (row["euler_number"], row["components"], row["nonmanifold_edges"], row["boundary_edges"])
    return counts == (2, 1, 0, 0)
