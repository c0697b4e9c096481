"""Claims 2 and 5: the theorem, and the error caused by random directions."""

from meshot_book.claims.ledger import ASSUMING, IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

#: Largest deviation of a slope in L from −½, and of a constant from one.
SLOPE_TOLERANCE, CONSTANT_TOLERANCE = 0.02, 0.05
#: With fewer directions than this, a few draws from the heavy tail of the costs dominate the error.
LEAST_DIRECTIONS = 10
#: If the constant depended only on the diameters of the supports, this ratio of errors would be about one.
LARGEST_RATIO = 2.0


def theorem_verdict(record: dict) -> Verdict:
    """Claim 2 from ``experiments/convergence``: is the error at most C·R·√((d+1) log m / m), C of p and R alone?

    The rate holds if the whole interval of the slope is at or below the slope of √(log m / m) over the same sizes. The
    constant fails if the error grows with the distance between unchanged supports.
    """
    results = record["results"]
    slower = [row for row in results["sizes"] if row["high"] > row["bound_slope"]]
    above = [row for row in results["bounds"] if row["slice_error"] > row["sharper"]]
    above += [row for row in results["distance"] if any(e > b for e, b in zip(row["error"], row["sharper"]))]
    grown = [row for row in results["distance"] if row["p"] > 1 and row["ratio_low"][-1] > LARGEST_RATIO]
    status = ASSUMING if grown else REPRODUCED
    if slower or above:
        status = NOT_REPRODUCED
    return Verdict(
        status=status,
        says=_theorem_verdict_in_words(results, slower, grown),
        headline=_theorem_headline(results, slower, grown),
        ours=_theorem_sentence(results, slower, grown, above),
        tolerance=(
            "the rate holds if for every pair and exponent the 95 % interval of the slope in m lies at or below the "
            "slope that √(log m / m) has over the same sizes, and if no measured error exceeds "
            "p·D^(p−1)·(R₁ + R₂)/(2√m); under a further assumption if for some p > 1 the error grows more than twofold "
            "(whole interval) while only the distance between the supports does: then the constant must contain D"
        ),
        numbers="\n\n".join([_slope_table(results["sizes"]), _distance_table(results["distance"])]),
    )


def _theorem_verdict_in_words(results: dict, slower: list[dict], grown: list[dict]) -> str:
    n_cases = len(results["sizes"])
    rate = f"The rate $m^{{-1/2}}$ holds in {n_cases - len(slower)} of {n_cases} cases"
    if not grown:
        return f"{rate}, with a constant that depends on the diameters of the surfaces alone."
    exponents = " and ".join(str(p) for p in sorted({row["p"] for row in grown}))
    return f"{rate}, but for p = {exponents} the constant must contain the distance between the surfaces as well."


def _worst_at_distance(grown: list[dict]) -> dict:
    """The row for p = 2, the paper's exponent, whose error grows most with the distance."""
    return max((row for row in grown if row["p"] == 2), key=lambda row: row["ratio"][-1], default=grown[0])


def _theorem_headline(results: dict, slower: list[dict], grown: list[dict]) -> tuple[str, str]:
    if not grown:
        return f"{len(results['sizes']) - len(slower)} of {len(results['sizes'])}", "cases with the stated rate"
    most = _worst_at_distance(grown)
    growth = f"{digits(most['ratio'][-1], 2)} times"
    return (
        growth,
        f"larger error (p = {most['p']}) when the same spheres are {most['apart'][-1]} mm apart, not concentric",
    )


def _theorem_sentence(results: dict, slower: list[dict], grown: list[dict], above: list[dict]) -> str:
    rows = {(row["pair"], row["p"]): row for row in results["sizes"]}
    names = (("generic", 1), ("generic", 2), ("equal", 1), ("equal", 2), ("disconnected", 2), ("concentric", 2))
    slopes = ", ".join(f"{_interval(rows[name])} ({name[0]}, p = {name[1]})" for name in names if name in rows)
    holds = f"not slower than the bound in {len(results['sizes']) - len(slower)} of {len(results['sizes'])}"
    text = f"slope in m: {slopes}; {holds}"
    if grown:
        most = _worst_at_distance(grown)
        text += (
            f"; the constant depends on more than R: spheres {most['apart'][-1]} mm apart err "
            f"{digits(most['ratio'][-1], 3)} times as much as concentric ones, and "
            f"{digits(most['ratio'][-1] / most['ratio'][1], 3)} times as much as {most['apart'][1]} mm apart "
            f"(p = {most['p']}, m = {most['n_points']})"
        )
    bound = "p·D^(p−1)·(R₁ + R₂)/(2√m), D the joint diameter, without logarithm and d,"
    return text + (f"; {bound} holds throughout" if not above else f"; {bound} is exceeded {len(above)} times")


def _interval(row: dict) -> str:
    return f"{row['slope']:.2f} [{row['low']:.2f}, {row['high']:.2f}]".replace("-", "−")


def _slope_table(rows: list[dict]) -> str:
    return markdown_table(
        [
            {"pair": row["pair"], "d": row["d"], "p": row["p"], "slope in m": _interval(row)}
            | {"upper half of the sizes": _interval({key: row[f"upper_{key}"] for key in ("slope", "low", "high")})}
            | {"slope of √(log m / m)": f"{row['bound_slope']:.2f}".replace("-", "−")}
            | {"m": f"{row['points'][0]} to {row['points'][-1]}"}
            | {"repetitions": f"{row['n_repetitions'][0]} ({row['n_repetitions'][-1]} at the largest)"}
            for row in rows
        ]
    )


def _distance_table(rows: list[dict]) -> str:
    return markdown_table(
        [
            {"m": row["n_points"], "p": row["p"], "mm apart": apart, "error (mm^p)": error}
            | {"times the concentric one": f"{digits(ratio, 3)} [{digits(low, 3)}, {digits(high, 3)}]", "bound": bound}
            for row in rows
            for apart, error, ratio, low, high, bound in zip(
                row["apart"], row["error"], row["ratio"], row["ratio_low"], row["ratio_high"], row["sharper"]
            )
        ]
    )


def directions_verdict(record: dict) -> Verdict:
    """Claim 5 from ``experiments/convergence``: is the error over random directions √(Var/L)?"""
    rows = record["results"]["directions"]
    off_slope = [row for row in rows if max(abs(row[end] + 0.5) for end in ("low", "high")) > SLOPE_TOLERANCE]
    constants = [ratio for row in rows for count, ratio in _constants(row) if count >= LEAST_DIRECTIONS]
    off = [ratio for ratio in constants if abs(ratio - 1) > CONSTANT_TOLERANCE]
    slopes = [row["slope"] for row in rows]
    ends = [f"{value:.3f}".replace("-", "−") for value in (min(slopes), max(slopes))]
    absolute = [row["absolute_over_rms"][-1] for row in rows]
    return Verdict(
        status=NOT_REPRODUCED if off_slope else IN_PART if off else REPRODUCED,
        says=(
            f"The root-mean-square error over L random directions has the slope $-1/2$ in {len(rows) - len(off_slope)} "
            f"of {len(rows)} cases, with the constant $\\sqrt{{\\mathrm{{Var}}/L}}$ to within "
            f"{max(abs(ratio - 1) for ratio in constants):.0%}."
        ),
        headline=(f"{ends[0]} to {ends[1]}", "slope of the error in L"),
        ours=(
            f"slope in L of the root mean square: {ends[0]} to {ends[1]} over {len(rows)} cases; times √(L/Var): "
            f"{min(constants):.3f} to {max(constants):.3f}; the mean absolute error is {min(absolute):.2f} to "
            f"{max(absolute):.2f} of it at the largest L"
        ),
        tolerance=(
            f"reproduced if in every case the 95 % interval of the slope lies within ±{SLOPE_TOLERANCE} of −½ and, "
            f"from L = {LEAST_DIRECTIONS} on, the root mean square is √(Var/L) to ±{CONSTANT_TOLERANCE:.0%}; in part "
            "if only the slope is"
        ),
        numbers=_direction_table(rows),
    )


def _constants(row: dict) -> list[tuple[int, float]]:
    return list(zip(row["counts"], row["constant"], strict=True))


def _direction_table(rows: list[dict]) -> str:
    return markdown_table(
        [
            {"case": row["case"], "p": row["p"], "mean (mm^p)": row["mean"], "sd (mm^p)": row["variance"] ** 0.5}
            | {"slope in L": f"{row['slope']:.3f} [{row['low']:.3f}, {row['high']:.3f}]".replace("-", "−")}
            | {f"constant, L = {count}": f"{ratio:.3f}" for count, ratio in _constants(row)[::2]}
            for row in rows
        ]
    )
