"""Claim 12: guarantees of a Lipschitz flow for points, and self-intersections of the triangles between them."""

import itertools

import numpy as np

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

_NAMES = {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}


def self_intersection_verdict(record: dict) -> Verdict:
    """Claim 12 from ``experiments/self_intersection``: does a Lipschitz flow prevent self-intersection of a mesh?

    Moved meshes count if the theorem applies to their points: Euler steps with h·Lip < 1 along the paths and no flip.
    Reproduced if no faces intersect there, nor in any fit by a flow. With a condition if faces do intersect, but for
    some grid spacing no fit by a flow has intersections under any loss, while free vertices have some.
    """
    results = record["results"]
    safe = _safe_cases(results["carried"])
    crossed = [row for row in safe if row["most"] > 0]
    by_spacing = _most_by_spacing(results["fits"])
    free, flows = by_spacing.pop(0.0), by_spacing
    clean = [spacing for spacing, most in flows.items() if most == 0]
    status = IN_PART if clean and free > 0 else NOT_REPRODUCED
    if not crossed and len(clean) == len(flows):
        status = REPRODUCED
    return Verdict(
        status=status,
        says=(
            "Points cannot cross, triangles can: faces crossed in "
            f"{len(crossed)} of {len(safe)} meshes carried by flows that are safe for points; {_fits_in_words(clean)}."
        ),
        headline=(f"{len(crossed)} of {len(safe)}", "meshes with crossing faces after a flow with h·Lip < 1"),
        ours=_sentence(safe, crossed, free, flows, clean),
        tolerance=(
            "reproduced if no face crosses another in any mesh carried by Euler steps with h·Lip < 1 and without a "
            "flip, nor in any fit by a flow; in part if some do, but none in any fit by flows of some "
            "fineness, under any loss, while free vertices leave some (exact counts)"
        ),
        numbers=_table(results["fits"], record["config"]),
    )


def _fits_in_words(clean: list[float]) -> str:
    if not clean:
        return "and some fit crossed at every fineness of the flow"
    return f"no fit crossed where the finest grid of the flow was {' or '.join(_list(clean).split(', '))} mm"


def _safe_cases(carried: list[dict]) -> list[dict]:
    """One entry for each moved mesh with h·Lip < 1 along its paths, by Euler steps, without a flip."""
    return [
        {"level": int(level), "most": found["most"], "flips": row["flips"]}
        for fit in carried
        for row in fit["rows"]
        if row["way"] == "euler" and row["step_times_lipschitz"] < 1 and row["flips"] == 0
        for level, found in row["levels"].items()
    ]


def _most_by_spacing(fits: list[dict]) -> dict[float, int]:
    """The largest number of intersecting faces, at the end or before, over fits of each spacing; 0 means no flow."""
    found: dict[float, int] = {}
    for row in fits:
        most = max(row["crossing"], row.get("most_on_the_way", 0))
        found[row["spacing"]] = max(found.get(row["spacing"], 0), most)
    return found


def _sentence(safe: list[dict], crossed: list[dict], free: int, flows: dict[float, int], clean: list[float]) -> str:
    finest = (
        f"none in any fit by flows with a finest grid of {_list(clean)} mm" if clean else "some in fits by every flow"
    )
    dirty = [spacing for spacing in flows if spacing not in clean]
    rest = "; ".join(f"up to {flows[spacing]} faces at {spacing:g} mm" for spacing in sorted(dirty, reverse=True))
    return (
        f"points are safe, triangles are not: with h·Lip < 1 and no flip, faces cross in {len(crossed)} of {len(safe)} "
        f"carried meshes; {finest}{'; ' + rest if rest else ''}; up to {free} faces where vertices are free"
    )


def _list(spacings: list[float]) -> str:
    return ", ".join(f"{spacing:g}" for spacing in sorted(spacings, reverse=True))


def _table(fits: list[dict], config: dict) -> str:
    """A row for every pair, loss, encoding and spacing: means over the seeds."""

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
