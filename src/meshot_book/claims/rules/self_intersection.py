"""Claim 12: what a Lipschitz flow promises, and what the triangles of a mesh make of it."""

import itertools

import numpy as np

from meshot.mesh.geometry import edge_lengths
from meshot.mesh.shapes import icosphere
from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

TWICE = 1.9  # cells so many times as wide as the mean edge count as about twice as wide
_NAMES = {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}


def self_intersection_verdict(record: dict, deforming: dict, trained: dict) -> Verdict:
    """Claim 12: does a Lipschitz flow keep a mesh from crossing itself?

    From ``experiments/self_intersection``, with the fits of ``experiments/deforming`` and the trained flows of
    ``experiments/ddot``. Carried meshes count where the theorem applies to the points: Euler steps with h·Lip < 1 along
    the paths and no flip. A fit has a wide flow if its finest cells are about twice as wide as the edges, or wider.
    """
    results, pairs = record["results"], record["config"]["pairs"]
    safe = _safe_cases(results["carried"])
    crossed = [row for row in safe if row["most"] > 0]
    flows = [row for row in results["fits"] if row["spacing"]]
    free = max(row["crossing"] for row in results["fits"] if not row["spacing"])
    wide = [row for row in flows if row["spacing"] >= TWICE * _mean_edge(pairs[row["pair"]])]
    dirty = [row for row in flows if _most(row)]
    elsewhere = _elsewhere(deforming, trained)
    clean = wide and not any(_most(row) for row in wide)
    status = IN_PART if clean and free else NOT_REPRODUCED
    if not crossed and not dirty and not any(n for n, _ in elsewhere.values()):
        status = REPRODUCED
    n_wide = sum(_most(row) > 0 for row in wide)
    fits = f"{n_wide or 'none'} of {len(wide)} fits"
    return Verdict(
        status=status,
        says=(
            "Points cannot cross, triangles can: faces crossed in "
            f"{len(crossed)} of {len(safe)} meshes carried by flows that are safe for points, and in {fits} by flows "
            "with cells about twice as wide as the edges, or wider."
        ),
        headline=(f"{len(crossed)} of {len(safe)}", "meshes with crossing faces after a flow with h·Lip < 1"),
        ours=_sentence(safe, crossed, free, dirty, fits, elsewhere),
        tolerance=(
            "reproduced if no face crosses another in any mesh carried by Euler steps with h·Lip < 1 and without a "
            "flip, nor in any fit or trained flow; in part if some do, but none in any fit by a flow whose finest "
            f"cells are at least {TWICE:g} times as wide as the mean edge, while free vertices leave some"
        ),
        numbers=_table(results["fits"], record["config"]),
    )


def _mean_edge(pair: dict) -> float:
    """The mean length of the edges of the sphere that a fit begins with, in mm."""
    return float(edge_lengths(icosphere(pair["level"], pair["radius"])).mean())


def _most(row: dict) -> int:
    """The most crossing faces of a fit, at the end or on the way."""
    return max(row["crossing"], row.get("most_on_the_way", 0))


def _elsewhere(deforming: dict, trained: dict) -> dict[str, tuple[int, int]]:
    """In how many of how many runs of the other experiments faces cross, by what was run."""
    cortex = [row for row in deforming["results"]["fits"] if row["target"].startswith("fsaverage5")]
    crossing = [row["end"]["intersecting_faces"] > 0 for row in cortex]
    found = {"fits to a cortex": (sum(crossing), len(crossing))}
    for role, name in (("ours", "DDOT"), ("rival", "CortexODE")):
        arm = trained["config"]["comparison"][role]
        shares = [row["flow_crossing_percent"]["mean"] for row in trained["results"]["summary"] if row["arm"] == arm]
        found[f"trained flows of {name}, groups of held-out subjects"] = (sum(x > 0 for x in shares), len(shares))
    return found


def _safe_cases(carried: list[dict]) -> list[dict]:
    """One entry for each carried mesh with h·Lip < 1 along its paths, by Euler, without a flip."""
    return [
        {"level": int(level), "most": found["most"], "flips": row["flips"]}
        for fit in carried
        for row in fit["rows"]
        if row["way"] == "euler" and row["step_times_lipschitz"] < 1 and row["flips"] == 0
        for level, found in row["levels"].items()
    ]


def _sentence(safe: list, crossed: list, free: int, dirty: list[dict], fits: str, elsewhere: dict) -> str:
    worst = {}
    for row in dirty:
        worst[row["spacing"]] = max(worst.get(row["spacing"], 0), _most(row))
    finer = ", ".join(f"up to {worst[spacing]} faces at {spacing:g} mm" for spacing in sorted(worst, reverse=True))
    others = "; ".join(f"{name}: {n} of {n_all}" for name, (n, n_all) in elsewhere.items())
    return (
        f"points are safe, triangles are not: with h·Lip < 1 and no flip, faces cross in {len(crossed)} of {len(safe)} "
        f"carried meshes and in {fits} by wide flows{'; ' + finer if finer else ''}; up to {free} faces where vertices "
        f"are free. Elsewhere with crossing faces: {others}"
    )


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
