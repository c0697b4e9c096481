"""Claims 3 and 4: convergence rates of W, sliced Wasserstein and Chamfer between samples."""

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import markdown_table

#: An exponent may lie outside a fitted interval by this and still count as agreeing, because logarithms and small
#: samples change fitted slopes by about as much.
SLACK = 0.05


def transport_rate_verdict(record: dict) -> Verdict:
    """Claim 3 from ``experiments/transport_rates``: SW as m^-½ in every dimension, W as m^(-1/d).

    Sliced Wasserstein agrees if the interval of its slope, widened by :data:`SLACK`, contains −½ for every pair with
    connected supports and without a symmetry (those for which theory gives −½). W agrees on a pair if its widened
    interval contains −1/d, where d is the dimension of the space.
    """
    transport = record["results"]["transport"]
    sliced = [row for row in record["results"]["sliced"] if row["expected"] is not None]
    right = [row for row in transport if holds(row, -1 / row["d"])]
    independent = all(holds(row, row["expected"]) for row in sliced)
    status = NOT_REPRODUCED
    if independent and right:
        status = REPRODUCED if len(right) == len(transport) else IN_PART
    return Verdict(
        status=status,
        says=(
            f"Sliced Wasserstein has the rate $m^{{-1/2}}$ in {sum(holds(row, row['expected']) for row in sliced)} of "
            f"{len(sliced)} cases with connected supports and no symmetry; $W_p$ has the rate $m^{{-1/d}}$ in only "
            f"{len(right)} of {len(transport)}, since it also depends on the dimension of the surface."
        ),
        headline=(f"{len(right)} of {len(transport)}", "cases in which $W_p$ has the stated rate"),
        ours=_transport_sentence(transport, sliced, right),
        tolerance=(
            f"slopes agree where the 95 % interval, widened by {SLACK}, contains the exponent; reproduced if SW agrees "
            "with −½ on all pairs with connected supports and no symmetry, and W with −1/d on all pairs; in part if W "
            "does so on some"
        ),
        numbers=_transport_table(record["results"]),
    )


def holds(row: dict, exponent: float) -> bool:
    """Whether the interval of a fitted slope, widened by :data:`SLACK`, contains an exponent."""
    return row["low"] - SLACK <= exponent <= row["high"] + SLACK


def _transport_sentence(transport: list[dict], sliced: list[dict], right: list[dict]) -> str:
    low, high = min(row["slope"] for row in sliced), max(row["slope"] for row in sliced)
    agreed = sum(holds(row, row["expected"]) for row in sliced)
    faster = [row for row in transport if row not in right and row["slope"] < -1 / row["d"]]
    slower = [row for row in transport if row not in right and row["slope"] > -1 / row["d"]]
    return (
        (
            f"SW_p: slopes from {low:.2f} to {high:.2f} in 2, 3 and 6 dimensions ({agreed} of {len(sliced)} agree with "
            f"−½); W_p follows m^(-1/d) in {len(right)} of {len(transport)} cases, pair × p ({_names(right)}), is "
            f"faster in {len(faster)} ({_names(faster)}), and slower in {len(slower)} ({_names(slower)})"
        )
        .replace("slopes from -", "slopes from −")
        .replace(" to -", " to −")
    )


def _names(rows: list[dict]) -> str:
    names = dict.fromkeys(f"{row['shape'].replace('_', ' ')} in R^{row['d']} {row['relation']}" for row in rows)
    return ", ".join(names) or "none"


def _slope(row: dict) -> str:
    return f"{row['slope']:.2f} [{row['low']:.2f}, {row['high']:.2f}]".replace("-", "−")


def _expected(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}".replace("-", "−")


def _transport_table(results: dict) -> str:
    """A row for each pair and exponent: the paper's exponent, the theoretical one, and both fitted slopes."""
    beside = {(row["shape"], row["d"], row["relation"], row["p"]): row for row in results["sliced"]}
    return markdown_table(
        [
            {
                "pair": f"{row['shape'].replace('_', ' ')}, {row['relation']}",
                "space": f"R^{row['d']}",
                "own dimension": row["dimension"],
                "p": row["p"],
                "−1/d": _expected(-1 / row["d"]),
                "W_p expected": _expected(row["expected"]),
                "W_p found": _slope(row),
                "SW_p found": _slope(beside[row["shape"], row["d"], row["relation"], row["p"]]),
            }
            for row in results["transport"]
        ]
    )


def chamfer_rate_verdict(record: dict) -> Verdict:
    """Claim 4 from ``experiments/transport_rates``: does sampled Chamfer lack a rate of convergence?

    A pair of surfaces has a rate, no worse than that of sliced Wasserstein, if the upper end of the interval of its
    slope is below −½ + :data:`SLACK`. Solids are shown but do not count, because the claim is about meshes.
    """
    rows = record["results"]["chamfer"]
    surfaces = [row for row in rows if row["dimension"] == 2 and row["shape"] != "cube"]
    fast = [row for row in surfaces if row["high"] <= -0.5 + SLACK]
    status = REPRODUCED if not fast else IN_PART
    if len(fast) == len(surfaces):
        status = NOT_REPRODUCED
    zero = [row for row in surfaces if row["relation"] in ("equal", "other_density")]
    other = [row for row in surfaces if row["relation"] == "other_surface"]
    solids = [row for row in rows if row not in surfaces and row["relation"] == "equal"]
    return Verdict(
        status=status,
        says=(
            "Sampled Chamfer converges as well: to the Chamfer distance between the surfaces, and no slower than "
            f"$m^{{-1/2}}$ on {len(fast)} of {len(surfaces)} pairs of surfaces."
        ),
        headline=(f"{len(fast)} of {len(surfaces)}", "pairs on which Chamfer has the rate $m^{-1/2}$ or a faster one"),
        ours=(
            f"it converges to the Chamfer distance between the surfaces, on {len(fast)} of {len(surfaces)} pairs no "
            f"slower than m^-½: slopes {_range(zero)} where the surfaces are equal (whatever the densities on them: "
            f"the limit is 0), {_range(other)} where they differ; its bias does know the dimension: on solids in 2, 3 "
            f"and 6 dimensions {_range(solids)}"
        ),
        tolerance=(
            f"not reproduced if on every pair of surfaces the 95 % interval of the slope ends below −½ + {SLACK}; "
            "in part if on some; reproduced if on none"
        ),
        numbers=_chamfer_table(rows, record["results"]["limits"]),
    )


def _range(rows: list[dict]) -> str:
    ends = sorted(row["slope"] for row in rows)
    return f"{ends[0]:.2f} to {ends[-1]:.2f}".replace("-", "−")


def _chamfer_table(rows: list[dict], limits: list[dict]) -> str:
    """A row for each pair: the limit and its source, the error at the largest sample, the slope."""
    known = {(row["shape"], row["d"], row["relation"]): row for row in limits}
    lines = []
    for row in rows:
        limit = known[row["shape"], row["d"], row["relation"]]
        lines.append(
            {
                "pair": f"{row['shape'].replace('_', ' ')}, {row['relation'].replace('_', ' ')}",
                "space": f"R^{row['d']}",
                "own dimension": row["dimension"],
                "limit": float(limit["limit"]),
                "known by": limit["known_by"],
                f"error at m = {row['sizes'][-1]}": float(row["error"][-1]),
                "slope expected": _expected(row["expected"]),
                "slope found": _slope(row),
            }
        )
    return markdown_table(lines)
