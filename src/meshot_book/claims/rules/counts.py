"""Claim 16: the shares of crossing faces, in print and in our trained flows, as counts.

The trained flows are those of ``experiments/comparison``, or those of ``experiments/ddot``.
"""

from collections.abc import Iterator

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, NOT_TESTED, REPRODUCED, Verdict
from meshot_book.claims.rules.comparison import STEPS, named
from meshot_book.notebook import digits, markdown_table

RIVAL = "cortexode"  # the system that the paper compares with in this claim


def counts_verdict(record: dict, trained: dict) -> Verdict:
    """Claim 16 from ``experiments/paper_table`` and trained flows: shares of intersecting faces, as counts.

    The status follows from the trained flows before repair: in how many columns (cohort and side) is DDOT below the
    bound, and CortexODE above DDOT by the stated factor? Shares of the paper's table are also given as face counts.
    """
    counts = record["results"]["counts"]
    n_faces, bound, wanted = counts["typical_faces"], counts["bound_percent"], counts["stated_factor"]
    (share,) = [row for row in counts["shares"] if row["n_faces"] == n_faces]
    factors = [row["factor"] for row in counts["factors"]]
    enough = [f >= wanted for f in factors]
    flows = _trained_columns(trained)
    holds = [f["ours"] <= bound and f["rival"] >= max(wanted * f["ours"], bound) for f in flows]
    status = IN_PART if any(holds) else NOT_REPRODUCED
    if all(holds) and all(enough):
        status = REPRODUCED
    return Verdict(
        status=status if flows else NOT_TESTED,
        says=(
            "In the trainings of chapter 38, at a small budget, both statements hold in "
            f"{sum(holds)} of {len(holds)} columns; in the paper's own table the factor {wanted} "
            f"over CortexODE is reached in {sum(enough)} of {len(factors)}."
        ),
        headline=(f"{sum(holds)} of {len(holds)}", "columns of our trained flows in which both statements hold"),
        ours=(
            f"crossing faces of our trained flows, before any repair (experiments/{_origin(trained)}): DDOT "
            f"{_percents(flows, 'ours')} %, CortexODE {_percents(flows, 'rival')} %. In print: with {n_faces} faces "
            f"one crossing pair is {digits(share['smallest_nonzero_percent'], 2)} %, so that < {bound:.0e} % means "
            f"zero on each surface, or a mean over {counts['n_scans']} scans of at most "
            f"{share['pairs_below_bound_over_scans']} pairs in all; the factor over CortexODE is at least "
            f"{', '.join(digits(f, 3) for f in factors)}: {wanted} or more in {sum(enough)} of {len(factors)} columns"
        ),
        tolerance=(
            f"a column of our trained flows (means over held-out subjects) agrees if DDOT is at or below {bound:.0e} % "
            f"and CortexODE above it by a factor of at least {wanted}; reproduced if all columns agree and the printed "
            "factor is reached in every column, in part if some agree, not reproduced otherwise"
        ),
        numbers=f"{_flows_table(flows)}\n\n{_shares_table(counts)}\n\n{_factor_table(counts)}",
    )


def _origin(trained: dict) -> str:
    return "comparison" if "table_1" in trained["results"] else "ddot"


def _trained_columns(trained: dict) -> list[dict]:
    """Crossing faces of DDOT and its rival in %, by cohort and side: first seed, training kind, unrepaired."""
    roles, columns = {trained["config"]["comparison"]["ours"]: "ours", RIVAL: "rival"}, {}
    for column, arm, percent in _shares(trained):
        if arm in roles:
            columns.setdefault(column, {})[roles[arm]] = percent
    both = {column: found for column, found in columns.items() if len(found) == 2}
    return [{"column": named(column)} | both[column] for column in sorted(both)]


def _shares(trained: dict) -> Iterator[tuple[tuple[str, str], str, float]]:
    """Column, arm and mean share of crossing faces in %. The first seed of ``experiments/ddot`` comes last."""
    results = trained["results"]
    if _origin(trained) == "comparison":
        for line in results["table_1"]:
            if (line["kind"], line["budget"]) == ("template", STEPS):
                yield (line["cohort"], line["side"]), line["arm"], line["crossing_percent"]["mean"]
        return
    for row in sorted(results["summary"], key=lambda row: -(row["seed"] or 0)):
        if row["kind"] == "template":
            yield (row["cohort"], row["side"]), row["arm"], row["flow_crossing_percent"]["mean"]


def _percents(flows: list[dict], role: str) -> str:
    return " | ".join(digits(flow[role], 3) for flow in flows)


def _flows_table(flows: list[dict]) -> str:
    return markdown_table(
        [
            {
                "our flows": flow["column"],
                "DDOT (%)": digits(flow["ours"], 3),
                "CortexODE (%)": digits(flow["rival"], 3),
            }
            for flow in flows
        ]
    )


def _shares_table(counts: dict) -> str:
    return markdown_table(
        [
            {
                "faces": row["n_faces"],
                "one pair (%)": digits(row["smallest_nonzero_percent"], 3),
                "pairs below the bound over all scans": row["pairs_below_bound_over_scans"],
            }
            for row in counts["shares"]
        ]
    )


def _factor_table(counts: dict) -> str:
    return markdown_table(
        [
            {
                "column": row["column"],
                "CortexODE (%)": digits(row["cortexode_percent"], 3),
                "faces": digits(row["cortexode_faces"], 3),
                "at least … times the bound": digits(row["factor"], 3),
            }
            for row in counts["factors"]
        ]
    )
