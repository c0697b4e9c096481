"""Claims 3 and 4: how fast W, sliced Wasserstein and Chamfer between samples come near their limits."""

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import markdown_table

#: How far beyond the ends of a fitted interval an exponent may lie and still count as agreed: logarithms and small
#: samples move fitted slopes by about as much.
SLACK = 0.05


def transport_rate_verdict(record: dict) -> Verdict:
    """Claim 3 from ``experiments/transport_rates``: SW like m^(-1/2) in every dimension, W like m^(-1/d).

    Sliced Wasserstein agrees if the interval of its slope, widened by :data:`SLACK`, holds −½ for every pair with
    connected supports and without a symmetry (those that theory gives −½). W agrees on a case if its widened interval
    holds −1/d, with d the dimension of the space. A case is undecided if its interval holds the exponent of theory (−½
    where theory gives none) as well, and the two differ.
    """
    transport = record["results"]["transport"]
    sliced = [row for row in record["results"]["sliced"] if row["expected"] is not None]
    rest = [row for row in record["results"]["sliced"] if row["expected"] is None]
    cases = _sorted_cases(transport)
    independent = all(holds(row, row["expected"]) for row in sliced)
    status = NOT_REPRODUCED
    if independent and cases["follows"]:
        status = REPRODUCED if len(cases["follows"]) == len(transport) else IN_PART
    return Verdict(
        status=status,
        says=(
            f"Sliced Wasserstein has the rate $m^{{-1/2}}$ in {sum(holds(row, row['expected']) for row in sliced)} of "
            f"{len(sliced)} cases with connected supports and no symmetry{_slow_in_words(rest)}. The rate of $W_p$ is "
            f"$m^{{-1/d}}$ in only {len(cases['follows'])} of {len(transport)}, as the surface's dimension counts."
        ),
        headline=(f"{len(cases['follows'])} of {len(transport)}", "cases in which $W_p$ has the stated rate"),
        ours=_transport_sentence(transport, sliced, rest, cases),
        tolerance=(
            f"slopes agree where the 95 % interval, widened by {SLACK}, contains the exponent; a case of W is "
            "undecided if it contains the exponent of theory as well and the two differ; reproduced if SW agrees with "
            "−½ on all pairs with connected supports and no symmetry, and W with −1/d in all cases; in part if W "
            "does so in some"
        ),
        numbers=_transport_table(record["results"]),
    )


def _sorted_cases(transport: list[dict]) -> dict[str, list[dict]]:
    """The cases of W that follow m^(-1/d), are undecided, faster or slower."""
    cases: dict[str, list[dict]] = {"follows": [], "undecided": [], "faster": [], "slower": []}
    for row in transport:
        stated, other = -1 / row["d"], -0.5 if row["expected"] is None else row["expected"]
        if not holds(row, stated):
            cases["faster" if row["slope"] < stated else "slower"].append(row)
        elif abs(stated - other) > SLACK and holds(row, other):
            cases["undecided"].append(row)
        else:
            cases["follows"].append(row)
    return cases


def _slow_in_words(rest: list[dict]) -> str:
    """The other cases of SW that are slower than −½, for the verdict's sentence."""
    slow = [row for row in rest if row["low"] > -0.5]
    if not slow:
        return ""
    least = max(slow, key=lambda row: row["slope"])
    slope = f"{least['slope']:.2f}".replace("-", "−")
    return f" and is slower on {least['shape'].replace('_', ' ')} with p = {least['p']} (slope {slope})"


def holds(row: dict, exponent: float) -> bool:
    """Whether the interval of a fitted slope, widened by :data:`SLACK`, holds an exponent."""
    return row["low"] - SLACK <= exponent <= row["high"] + SLACK


def _transport_sentence(
    transport: list[dict], sliced: list[dict], rest: list[dict], cases: dict[str, list[dict]]
) -> str:
    agreed = sum(holds(row, row["expected"]) for row in sliced)
    others = "; ".join(
        f"{row['shape'].replace('_', ' ')} in R^{row['d']} {row['relation']}, p = {row['p']}: {_slope(row)}"
        for row in rest
    )
    parts = [
        f"SW_p: slopes {_range(sliced)} in 2, 3 and 6 dimensions ({agreed} of {len(sliced)} agree with −½)",
        f"not counted, because supports are disconnected or symmetric: {others or 'none'}",
        f"W_p follows $m^{{-1/d}}$ in {len(cases['follows'])} of {len(transport)} cases, pair × p "
        f"({_names(cases['follows'])}), is undecided in {len(cases['undecided'])} ({_names(cases['undecided'])}), "
        f"faster in {len(cases['faster'])} ({_names(cases['faster'])}), and slower in {len(cases['slower'])} "
        f"({_names(cases['slower'])})",
    ]
    return "; ".join(parts)


def _names(rows: list[dict]) -> str:
    names = dict.fromkeys(f"{row['shape'].replace('_', ' ')} in R^{row['d']} {row['relation']}" for row in rows)
    return ", ".join(names) or "none"


def _slope(row: dict) -> str:
    return f"{row['slope']:.2f} [{row['low']:.2f}, {row['high']:.2f}]".replace("-", "−")


def _expected(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}".replace("-", "−")


def _transport_table(results: dict) -> str:
    """A line for each pair and exponent: what the paper states, what theory says, and both slopes."""
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

    On a pair of surfaces it has one, no worse than that of sliced Wasserstein, if the upper end of the interval of its
    slope lies below −½ + :data:`SLACK`. Solids are shown beside, and do not count: the claim is about meshes.
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
            f"slower than $m^{{-1/2}}$: slopes {_range(zero)} where the surfaces are equal (whatever the densities on "
            f"them: the limit is 0), {_range(other)} where they differ; its bias depends on the dimension: on solids "
            f"in 2, 3 and 6 dimensions {_range(solids)}"
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
    """A line for each pair: the limit and how it is known, the error at the largest sample, the slope."""
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
