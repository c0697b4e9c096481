"""Claim 9: transport between measures of different sizes and masses, and the gradient through the areas."""

from meshot_book.claims.ledger import CHOICE, NOT_REPRODUCED, REPRODUCED, Verdict

LARGEST_ERROR = 1e-12
LIBRARIES = ("pot_sorting", "pot_linear_program", "scipy")


def weights_verdict(record: dict) -> Verdict:
    """Claim 9 from ``experiments/weights_and_areas``: is 1D transport correct, and must gradients include the areas?

    Transport is correct if it differs from POT and SciPy by roundoff alone. The choice of the gradient matters if the
    95 % interval of the paired difference in the exact sliced Wasserstein distance to the target, gradients stopped at
    the areas minus gradients through them, excludes zero.
    """
    results = record["results"]
    worst = max(row[name] for row in results["merging"] for name in LIBRARIES if name in row)
    better = [row for row in results["differences"] if row["sw_surface_low"] > 0]
    worse = [row for row in results["differences"] if row["sw_surface_high"] < 0]
    status = CHOICE if better or worse else REPRODUCED
    if worst > LARGEST_ERROR:
        status = NOT_REPRODUCED
    return Verdict(
        status=status,
        says=(
            f"Merged costs agree with two other libraries to {worst:.0e}; whether gradients pass through the areas, "
            f"which the paper does not state, changes the end of {len(better) + len(worse)} of "
            f"{len(results['differences'])} descents."
        ),
        headline=(
            f"{len(better) + len(worse)} of {len(results['differences'])}",
            "descents that depend on this choice",
        ),
        ours=_sentence(results, worst, better, worse),
        tolerance=(
            f"not reproduced if merged costs differ from those of POT or SciPy by more than {LARGEST_ERROR:g}; "
            "depending on the choice of gradient if stopping the gradients at the areas changes where descents end: "
            "if, for some target and encoding, the 95 % interval over seeds of the paired difference in SW₂ to the "
            "target excludes zero"
        ),
        numbers=_table(results),
    )


def _sentence(results: dict, worst: float, better: list[dict], worse: list[dict]) -> str:
    cases = sum(row["n_cases"] for row in results["merging"])
    counts = []
    for encoding in dict.fromkeys(row["encoding"] for row in results["differences"]):
        total, nearer, farther = (
            sum(row["encoding"] == encoding for row in rows) for rows in (results["differences"], better, worse)
        )
        counts.append(f"{encoding}: nearer on {nearer}, farther on {farther} of {total} targets")
    shares = [
        sum(row[f"tangential_{kind}_mean"] for row in results["gradients"]) / len(results["gradients"])
        for kind in ("full", "stopped")
    ]
    blind = results["areas"][0]
    return (
        f"Merged costs agree with POT and SciPy to {worst:.0e} in {cases} cases. With gradients through the areas, "
        f"descents end ({'; '.join(counts)}) than with gradients stopped there. On average {shares[0]:.1%} of the full "
        f"gradient lies along the surface, {shares[1]:.0%} of the stopped one. Normalised areas do not record the "
        f"total area: {blind['surface']}, {blind['area_ratio']:.2g} times the area, is at distance "
        f"{blind['sw_surface']:.0e}"
    )


def _table(results: dict) -> str:
    """Final distances of descents, with gradients through the areas and without, and the paired differences."""
    lines = [
        "| target | encoding | SW₂ to the target, through | stopped | stopped − through [95 %] | edge variation, "
        "through | stopped | seeds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in results["differences"]:
        cells = [row["target"].replace("_", " "), row["encoding"]]
        cells += [f"{row['sw_surface_full']:.5f}", f"{row['sw_surface_stopped']:.5f}"]
        gap, low, high = (row[f"sw_surface_{end}"] for end in ("gap", "low", "high"))
        cells.append(f"{gap:+.5f} [{low:+.5f}, {high:+.5f}]")
        cells += [f"{row['edge_variation_full']:.3f}", f"{row['edge_variation_stopped']:.3f}", str(row["n_seeds"])]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
