"""Claim 12: what a Lipschitz flow promises, and what the triangles of a mesh make of it."""

import itertools

import numpy as np

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

_NAMES = {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}


def self_intersection_verdict(record: dict, deforming: dict | None = None, ddot: dict | None = None) -> Verdict:
    """Claim 12 from ``experiments/self_intersection``: does a Lipschitz flow keep a mesh from crossing itself?

    Carried meshes count where the theorem applies to the points: Euler steps with h·Lip < 1 along the paths and no
    flip. Fits count with all flows, those of ``experiments/deforming`` included. Reproduced if no face crosses in any
    of them. In part if faces cross in fewer than half of the fits by flows, and less often than with free vertices.
    Networks of ``experiments/ddot`` are flows as well: a crossing face there rules out the first status.
    """
    results = record["results"]
    safe = _safe_cases(results["carried"])
    crossed = [row for row in safe if row["most"] > 0]
    by_spacing = _fits_by_spacing(results["fits"])
    free, flows = by_spacing.pop(0.0), by_spacing
    others = [int(row["end"]["intersecting_faces"]) for row in deforming["results"]["fits"]] if deforming else []
    fits = [most for found in flows.values() for most in found] + others
    networks = _networks(ddot["results"]["summary"]) if ddot else {}
    status = IN_PART if _share(fits) < min(0.5, _share(free)) else NOT_REPRODUCED
    if not crossed and not any(fits) and not any(high for _, high in networks.values()):
        status = REPRODUCED
    return Verdict(
        status=status,
        says=(
            "Points cannot cross, but triangles can: faces crossed in "
            f"{len(crossed)} of {len(safe)} meshes carried by flows that are safe for points, and in {_count(fits)} "
            f"fits by flows, against {_count(free)} fits with free vertices."
        ),
        headline=(f"{len(crossed)} of {len(safe)}", "meshes with crossing faces after a flow with h·Lip < 1"),
        ours=_sentence(safe, crossed, free, flows, others, networks),
        tolerance=(
            "reproduced if no face crosses another in any mesh carried by Euler steps with h·Lip < 1 and without a "
            "flip, in any fit by a flow, and in any surface of a trained network; in part if faces cross in fewer than "
            "half of the fits by flows and in a smaller share of them than of the fits with free vertices (exact "
            "counts)"
        ),
        numbers=_table(results["fits"], record["config"]),
    )


def _share(counts: list[int]) -> float:
    return sum(count > 0 for count in counts) / len(counts)


def _count(counts: list[int]) -> str:
    return f"{sum(count > 0 for count in counts)} of {len(counts)}"


def _safe_cases(carried: list[dict]) -> list[dict]:
    """One entry for each carried mesh with h·Lip < 1 along its paths, by Euler, without a flip."""
    return [
        {"level": int(level), "most": found["most"], "flips": row["flips"]}
        for fit in carried
        for row in fit["rows"]
        if row["way"] == "euler" and row["step_times_lipschitz"] < 1 and row["flips"] == 0
        for level, found in row["levels"].items()
    ]


def _fits_by_spacing(fits: list[dict]) -> dict[float, list[int]]:
    """For every fineness the most crossing faces, at the end or on the way, of each fit; 0 is no flow."""
    found: dict[float, list[int]] = {}
    for row in fits:
        found.setdefault(row["spacing"], []).append(max(row["crossing"], row.get("most_on_the_way", 0)))
    return found


def _networks(summary: list[dict]) -> dict[str, tuple[float, float]]:
    """For DDOT and CortexODE the smallest and the largest mean share of crossing faces of a cohort, in %."""
    names = {"ddot": "DDOT", "cortexode": "CortexODE"}
    found: dict[str, tuple[float, float]] = {}
    for arm, name in names.items():
        shares = [row["flow_crossing_percent"]["mean"] for row in summary if row["arm"] == arm]
        if shares:
            found[name] = min(shares), max(shares)
    return found


def _sentence(
    safe: list[dict],
    crossed: list[dict],
    free: list[int],
    flows: dict[float, list[int]],
    others: list[int],
    networks: dict[str, tuple[float, float]],
) -> str:
    by_fineness = ", ".join(
        f"{_count(flows[spacing])} with a finest grid of {spacing:g} mm" for spacing in sorted(flows, reverse=True)
    )
    parts = [
        f"with h·Lip < 1 and no flip, faces cross in {len(crossed)} of {len(safe)} carried meshes",
        f"fits by flows that cross, at the end or on the way: {by_fineness}",
    ]
    if others:
        parts.append(f"{_count(others)} in the fits of chapter 21 (up to {max(others)} faces)")
    parts.append(f"free vertices: {_count(free)} (up to {max(free)} faces)")
    if networks:
        shares = "; ".join(f"{name} {digits(low, 2)} to {digits(high, 2)} %" for name, (low, high) in networks.items())
        parts.append(f"trained networks, mean share of crossing faces by cohort and side: {shares}")
    return "; ".join(parts)


def _table(fits: list[dict], config: dict) -> str:
    """A row for every pair, loss, encoding and fineness: means over the seeds."""

    def name(row: dict) -> tuple:
        return row["pair"], row["loss"], row["encoding"], row["spacing"]

    rows = []
    for (pair, loss, encoding, spacing), group in itertools.groupby(sorted(fits, key=name), key=name):
        found = list(group)
        n_faces = 20 * 4 ** config["pairs"][pair]["level"]
        crossing = np.array([row["crossing"] for row in found], dtype=float)
        steep = [row["step_times_lipschitz"] for row in found if "step_times_lipschitz" in row]
        rows.append(
            {
                "surface": f"{pair}, {n_faces} faces",
                "loss": f"{_NAMES[loss]}, {encoding}",
                "finest grid (mm)": f"{spacing:g}" if spacing else "no flow",
                "crossing faces": f"{crossing.mean():.1f} ± {crossing.std(ddof=1):.1f}",
                "SI (%)": digits(100 * crossing.mean() / n_faces, 2),
                "h·Lip": digits(np.mean(steep), 2) if steep else "",
                "ASSD (mm)": digits(np.mean([row["assd"] for row in found]), 3),
                "seeds": len(found),
            }
        )
    return markdown_table(rows)
