"""Claim 24: the ground cost whose p-th power is transported."""

from meshot_book.claims.ledger import ASSUMING, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

#: Two costs count as equal if they differ by at most this, the error of solvers and of finitely many directions.
AGREES = 0.01


def ground_cost_verdict(record: dict) -> Verdict:
    """Claim 24 from ``experiments/ground_cost``: is the cost of transport the sum of p-th powers over coordinates?

    Reproduced if both costs give the same values between surfaces for every exponent; under a further assumption if
    they do for some exponents, which are named; else not reproduced.
    """
    results = record["results"]
    same = [row["p"] for row in results["summary"] if abs(row["ratio_mean"] - 1) < AGREES]
    status = ASSUMING if same else NOT_REPRODUCED
    if len(same) == len(results["summary"]):
        status = REPRODUCED
    return Verdict(
        status=status,
        says=_verdict_in_words(results, same),
        headline=_headline(results, same),
        ours=_sentence(results, same),
        tolerance=(
            "reproduced if between sampled surfaces ‖x − y‖_p^p and ‖x − y‖₂^p give the same W_p^p (to "
            f"{AGREES:.0%}) for every exponent tried; under a further assumption if for some. A loss counts as "
            f"Euclidean if it is the same (to {AGREES:.0%}) for two points one step apart along an axis or a diagonal"
        ),
        numbers="\n\n".join(markdown_table(rows) for rows in (_surfaces(results), _losses(results))),
    )


def _verdict_in_words(results: dict, same: list[float]) -> str:
    others = [str(row["p"]) for row in results["summary"] if row["p"] not in same]
    if not others:
        return "The printed cost gives the same values as the Euclidean one for every exponent tried."
    agree = f"for p = {', '.join(map(str, same))}" if same else "for no exponent tried"
    return (
        f"The printed cost equals the Euclidean one {agree}; for p = {' and '.join(others)} it gives other values and "
        "other gradients, and it changes when both surfaces are rotated."
    )


def _headline(results: dict, same: list[float]) -> tuple[str, str]:
    others = [row for row in results["summary"] if row["p"] not in same] or results["summary"]
    row = max(others, key=lambda row: abs(row["ratio_mean"] - 1))
    return f"{digits(row['ratio_mean'], 3)} times", f"the Euclidean cost, for p = {row['p']}"


def _sentence(results: dict, same: list[float]) -> str:
    others = [row for row in results["summary"] if row["p"] not in same]
    where = f"both costs agree for p = {', '.join(str(p) for p in same)}" if same else "the costs never agree"
    differ = "; ".join(
        f"for p = {row['p']} the paper's gives {digits(row['ratio_mean'], 3)} times the Euclidean W_p^p, has gradients "
        f"{digits(row['mean_angle_degrees_mean'], 2)}° apart, and changes by up to "
        f"{row['turning_coordinates_mean']:.1%} when both surfaces are rotated"
        for row in others
    )
    euclidean = [row for row in results["asked"] if abs(row["diagonal_over_axis"] - 1) < AGREES]
    ours = (
        f"{len(euclidean)} of {len(results['asked'])} losses and metrics of ours, tested with two points, are Euclidean"
    )
    return "; ".join(part for part in (where, differ, ours) if part)


def _surfaces(results: dict) -> list[dict]:
    """Both costs between two surfaces."""
    return [
        {
            "p": row["p"],
            "W_p, Euclidean (mm)": row["euclidean_root_mm_mean"],
            "W_p, coordinates (mm)": row["coordinates_root_mm_mean"],
            "ratio of W_p^p": row["ratio_mean"],
            "other partner": f"{row['other_partner_mean']:.0%}",
            "angle of gradients (°)": row["mean_angle_degrees_mean"],
            "change by turning, Euclidean": f"{row['turning_euclidean_mean']:.2%}",
            "coordinates": f"{row['turning_coordinates_mean']:.2%}",
            "minimisers apart (mm)": row["minimisers_apart_mm_mean"],
            "seeds": row["n_seeds"],
        }
        for row in results["summary"]
    ]


def _losses(results: dict) -> list[dict]:
    """The cost of a step under each loss, and its dependence on the direction of the step."""
    return [
        {
            "loss": row["loss"],
            "p": row["p"],
            "cost of a step z over ‖z‖₂^p": row["axis_over_step"],
            "diagonal over axis": row["diagonal_over_axis"],
            "Σ|zₖ|^p would say": row["coordinates_would_say"],
        }
        for row in results["asked"]
    ]
