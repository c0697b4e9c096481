"""Claims 6, 8 and 23: encodings of a mesh as a measure, and their gradients."""

from meshot_book.claims.ledger import CHOICE, IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

ROUNDOFF, BY_DIFFERENCES = 1e-11, 1e-5
SEEN = (0.05, 0.95)  # range of a part's share of the gradient in which both parts influence the loss
CONTROLS = ("white and shifted", "white and inside out")  # pairs that differ in positions or in normals only
CLOSE = 0.1


def continuous_verdict(record: dict) -> Verdict:
    """Claim 6 from ``experiments/exact_value``: is the continuous encoding of theoretical use only?

    It is of practical use if value and gradient are exact, if both together cost less than 10⁵ samples, and if a
    descent with it reaches the target in every run.
    """
    results = record["results"]
    error = max(row["error"] for row in results["accuracy"]["values"])
    slope_error = max(row["largest_relative_error"] for row in results["accuracy"]["gradients"])
    ratio = results["time"]["ratio_to_exact"]["100000 points"]
    runs = [row for row in results["descent"] if row["encoding"] == "continuous"]
    left = max(row["end"]["sliced_distance"] / row["start"]["sliced_distance"] for row in runs)
    accurate = error <= ROUNDOFF and slope_error <= BY_DIFFERENCES
    status = REPRODUCED if not accurate else IN_PART
    if accurate and ratio > 1 and left < CLOSE:
        status = NOT_REPRODUCED
    errors = [_at(row, 100_000)["rms_error"] for row in results["sampling"]]
    return Verdict(
        status=status,
        says=(
            "The continuous measure can be used directly: its value and gradient are exact, "
            f"{'cheaper' if ratio > 1 else 'but dearer'} than with 100 000 samples, and descents on it leave at most "
            f"{left:.1%} of the distance."
        ),
        headline=(f"{ratio:.1f} times", "CPU time of 100 000 samples over that of the exact value"),
        ours=(
            f"value right to {error:.0e}, gradient to {slope_error:.0e} of differences; 100 000 samples a side take "
            f"{ratio:.1f} times its CPU time and err by {_percent(min(errors))} to {_percent(max(errors))} of the "
            f"value, most on a tiny deformation; a descent on it leaves at most {left:.1%} of the distance"
        ),
        tolerance=(
            "not reproduced (of use in practice) if all values agree with closed forms or quadrature to "
            f"{ROUNDOFF:.0e}, gradients with differences to {BY_DIFFERENCES:.0e}, value and gradient cost less than "
            f"with 100 000 samples, and every descent ends below {CLOSE:.0%} of the distance it started from; in part "
            "if only the accuracy holds"
        ),
        numbers=f"{_sampling_table(results['sampling'])}\n\n{_descent_table(results['descent'])}",
    )


def _at(row: dict, n_points: int) -> dict:
    return next(sampled for sampled in row["sampled"] if sampled["n_points"] == n_points)


def _sampling_table(rows: list[dict]) -> str:
    shown = []
    for row in rows:
        cells = {"surfaces (mm)": row["pair"], "exact SW₂² (mm²)": row["exact"]}
        for sampled in row["sampled"]:
            cells[f"rms error of {sampled['n_points']:,} points"] = _percent(sampled["rms_error"])
        cells["error of barycentres"] = _percent(row["barycentres"])
        shown.append(cells)
    return markdown_table(shown)


def _percent(share: float) -> str:
    """The share in per cent; as a multiple above tenfold; as zero within roundoff."""
    if abs(share) >= 10:
        return f"{digits(share, 3)} times"
    return f"{digits(100 * share, 3)} %" if abs(share) > 1e-9 else "0 %"


def _descent_table(rows: list[dict]) -> str:
    shown = []
    for encoding in dict.fromkeys(row["encoding"] for row in rows):
        ends = [row["end"] for row in rows if row["encoding"] == encoding]
        cells = {"descent on": encoding, "runs": len(ends)}
        for key, title in (("sliced_distance", "exact SW₂ at the end (mm)"), ("surface_distance", "ASSD (mm)")):
            values = [end[key] for end in ends]
            cells[title] = (
                f"{digits(sum(values) / len(values), 3)} ({digits(min(values), 3)} to {digits(max(values), 3)})"
            )
        shown.append(cells)
    return markdown_table(shown)


def normal_scale_verdict(record: dict) -> Verdict:
    """Claim 8 from ``experiments/normal_scale``: can positions and unit normals share one space, in any unit?

    Both parts influence the loss if each has at least a twentieth of the gradient. The two conventions are vertices in
    mm (a normal has length 1 mm) and coordinates in [-1, 1] (a normal has half the largest extent).
    """
    pairs = [row for row in record["results"]["pairs"] if row["pair"] not in CONTROLS]
    conventions = [_share(row, scale) for row in pairs for scale in (1.0, row["half_extent"])]
    scales = [
        r["scale"] for r in pairs[0]["rows"] if all(_has(row, r["scale"]) and _seen(row, r["scale"]) for row in pairs)
    ]
    status = CHOICE if scales else NOT_REPRODUCED
    if all(SEEN[0] <= share["gradient_share"] <= SEEN[1] for share in conventions):
        status = REPRODUCED
    in_mm, in_box = conventions[::2], conventions[1::2]
    both = (
        f"both contribute in every pair for normals of {scales[0]:.2g} to {scales[-1]:.2g} mm"
        if scales
        else "no scale fits all"
    )
    return Verdict(
        status=status,
        says=(
            f"The answer depends on the unit: normals carry {_range(in_mm, 'gradient_share')} of the gradient with "
            f"vertices in millimetres, {_range(in_box, 'gradient_share')} with coordinates in [−1, 1]."
        ),
        headline=(
            (
                f"{scales[0]:.2g} to {scales[-1]:.2g} mm",
                "length of a unit normal at which both positions and normals contribute",
            )
            if scales
            else ("none", "length of a unit normal at which both positions and normals contribute in every pair")
        ),
        ours=(
            f"vertices in mm: normals make {_range(in_mm, 'share')} of SW₂² and {_range(in_mm, 'gradient_share')} of "
            f"its gradient; coordinates in [-1, 1]: {_range(in_box, 'share')} and {_range(in_box, 'gradient_share')}; "
            f"{both}"
        ),
        tolerance=(
            "reproduced if under both conventions the normals' part of the gradient lies between 5 % and 95 % in every "
            "pair that differs in both; depending on the choice of scale if there is one at which it does"
        ),
        numbers=_scale_table(record["results"]["pairs"]),
    )


def _has(row: dict, scale: float) -> bool:
    return any(entry["scale"] == scale for entry in row["rows"])


def _share(row: dict, scale: float) -> dict:
    return min(row["rows"], key=lambda entry: abs(entry["scale"] - scale))


def _seen(row: dict, scale: float) -> bool:
    return SEEN[0] <= _share(row, scale)["gradient_share"] <= SEEN[1]


def _range(shares: list[dict], key: str) -> str:
    values = [share[key] for share in shares]
    return f"{digits(100 * min(values), 2)} to {digits(100 * max(values), 2)} %"


def _scale_table(rows: list[dict]) -> str:
    shown = []
    for row in rows:
        cells = {"surfaces": row["pair"]}
        for name, scale in (("1 mm", 1.0), ("10 mm", 10.0), ("[-1, 1]", row["half_extent"])):
            share = _share(row, scale)
            cells[f"{name}: of the value"] = _percent(share["share"])
            cells[f"{name}: of the gradient"] = _percent(share["gradient_share"])
        half = row["half_of_loss_at"]
        cells["half of the value at (mm)"] = "–" if half is None else digits(half, 3)
        shown.append(cells)
    return markdown_table(shown)


def sample_gradient_verdict(record: dict) -> Verdict:
    """Claim 23 from ``experiments/sample_gradient``: can a mesh be optimised through points sampled from it?

    Fixed draws are biased if the 95 % interval of their mean slope excludes the exact slope. The effect of the bias is
    measured at the end of a descent that cannot reach its target.
    """
    results = record["results"]
    rows = results["curve"] + results["losses"]
    biased = [row for row in rows if not row["fixed_draws"]["low"] <= row["exact"] <= row["fixed_draws"]["high"]]
    few = min(row["n_corners"] for row in results["descent"])
    best, sampled = (_mean_end(results["descent"], few, kind) for kind in ("continuous", "samples, fixed draws"))
    works = sampled <= (1 + CLOSE) * best
    status = NOT_REPRODUCED if not works else (CHOICE if biased else REPRODUCED)
    curve, shares = rows[0], [row["fixed_draws"]["mean"] / row["exact"] for row in rows]
    return Verdict(
        status=status,
        says=(
            f"At fixed draws the gradient is {'biased' if biased else 'unbiased'} in {len(biased) or len(rows)} of "
            f"{len(rows)} cases, but a descent by samples {'ends close to' if works else 'ends far from'} the descent "
            "by the exact gradient."
        ),
        headline=(
            f"{min(shares):.0%} to {max(shares):.0%}",
            "share of the exact slope in the gradient through fixed samples",
        ),
        ours=(
            f"biased in {len(biased)} of {len(rows)} cases: on an L {_interval(curve['fixed_draws'])} instead of "
            f"{digits(curve['exact'])}, over all cases {min(shares):.0%} to {max(shares):.0%} of the exact slope; with "
            f"carried probabilities {_interval(curve['carried'])} on the L; a descent that cannot reach its target "
            f"ends at SW₂ = {digits(sampled)}, with the exact gradient at {digits(best)}"
        ),
        tolerance=(
            "reproduced if in every case the 95 % interval of the mean slope over draws contains the exact slope, and "
            f"a descent by samples to an unreachable target ends within {CLOSE:.0%} of the one by the exact gradient; "
            "depending on the choice if only the descent does"
        ),
        numbers=f"{_slope_table(rows)}\n\n{_ends_table(results['descent'])}",
    )


def _mean_end(rows: list[dict], n_corners: int, kind: str) -> float:
    ends = [r["sliced_distance"] for r in rows if (r["n_corners"], r["kind"]) == (n_corners, kind)]
    return sum(ends) / len(ends)


def _interval(slope: dict) -> str:
    return f"{digits(slope['mean'])} ({digits(slope['low'])} to {digits(slope['high'])})"


def _slope_table(rows: list[dict]) -> str:
    return markdown_table(
        [
            {
                "slope of": row["case"],
                "points": row["n_points"],
                "exact": row["exact"],
                "by differences": row["by_differences"],
                "exact, weights fixed": row["exact_fixed_weights"],
                "fixed draws, mean (95 %)": _interval(row["fixed_draws"]),
                "carried, mean (95 %)": _interval(row["carried"]),
            }
            for row in rows
        ]
    )


def _ends_table(rows: list[dict]) -> str:
    kinds, corners = (list(dict.fromkeys(row[key] for row in rows)) for key in ("kind", "n_corners"))
    return markdown_table(
        [
            {"descent by": kind}
            | {f"SW₂ at the end, {n} corners": digits(_mean_end(rows, n, kind), 3) for n in corners}
            for kind in kinds
        ]
    )
