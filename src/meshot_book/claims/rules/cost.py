"""Claims 10 and 21: time and memory, from the benchmark of losses."""

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

OURS, TREE, BRUTE = "sliced, fused", "Chamfer, k-d tree", "Chamfer, brute force"
SMALLEST = 10_000  # support points; with fewer, all losses are fast
HIGHEST_EXPONENT = 1.5  # the mean of the exponents of m and m²


def speed_verdict(record: dict) -> Verdict:
    """Claim 10 from ``experiments/cost``: does sorting scale as m log m, and is it faster than Chamfer?"""
    cases = [row for row in record["results"]["cases"] if row["m"] >= SMALLEST]
    ratios = {rival: _ratios(cases, rival) for rival in (BRUTE, TREE)}
    grown = {
        row["d"]: row["exponent"]
        for row in record["results"]["exponents"]
        if row["peer"] == OURS and row["quantity"] == "seconds"
    }
    scales = bool(grown) and max(grown.values()) < HIGHEST_EXPONENT
    beats_pairs = bool(ratios[BRUTE]) and min(ratios[BRUTE].values()) > 1
    beats_tree = bool(ratios[TREE]) and min(ratios[TREE].values()) > 1
    status = NOT_REPRODUCED
    if scales and beats_pairs:
        status = REPRODUCED if beats_tree else IN_PART
    exponents = ", ".join(f"{digits(value, 3)} (d = {d})" for d, value in sorted(grown.items()))
    return Verdict(
        status=status,
        says=(
            f"Time grows with exponent {digits(max(grown.values(), default=0.0), 3)} in m; Chamfer takes "
            f"{_range(ratios[BRUTE])} the time of sliced Wasserstein by brute force, and {_range(ratios[TREE])} with a "
            "k-d tree."
        ),
        headline=(_range(ratios[TREE]), "time of Chamfer with a k-d tree over that of sliced Wasserstein"),
        ours=(
            f"time grows with exponent {exponents} from m = {SMALLEST} on; Chamfer takes {_range(ratios[BRUTE])} the "
            f"time of sliced Wasserstein (L = {record['config']['n_directions']}) by brute force, but "
            f"{_range(ratios[TREE], 3)} with a k-d tree at d = 3 and {_range(ratios[TREE], 6)} at d = 6"
        ),
        tolerance=(
            f"reproduced if the exponent is below {HIGHEST_EXPONENT} and sliced Wasserstein, value and gradient, is "
            f"faster than Chamfer at every size from {SMALLEST} on, by brute force and with a k-d tree; in part if "
            "only brute force is slower throughout"
        ),
        numbers=_by_size(cases, "seconds", "s"),
    )


def _ratios(cases: list[dict], rival: str) -> dict[tuple[int, int], float]:
    """The ratios of the rival's seconds to ours, by (d, m)."""
    seconds = {(row["peer"], row["d"], row["m"]): row["seconds"] for row in cases}
    return {(d, m): s / seconds[OURS, d, m] for (peer, d, m), s in seconds.items() if peer == rival}


def _range(ratios: dict[tuple[int, int], float], d: int | None = None) -> str:
    found = [ratio for (own, _), ratio in ratios.items() if d in (None, own)]
    if not found:
        return "(not measured)"
    return " to ".join(dict.fromkeys(f"{digits(value, 3)}×" for value in (min(found), max(found))))


def memory_verdict(record: dict) -> Verdict:
    """Claim 21 from ``experiments/cost``: must Sinkhorn store a number for every pair of support points?

    The rule compares a library's dense variant with its lazy one, at the largest size at which the dense one was run.
    """
    memory = record["results"]["memory"]
    shares, said = {}, []
    for library in ("GeomLoss", "OTT"):
        dense, lazy = ({(r["d"], r["m"]): r["bytes"] for r in memory if r["peer"] == _name(library, k)} for k in KINDS)
        for d in sorted({d for d, _ in dense.keys() & lazy.keys()}):
            m = max(m for own, m in dense.keys() & lazy.keys() if own == d)
            shares[library, d] = lazy[d, m] / dense[d, m]
            megabytes = (digits(side[d, m] / 1e6, 2) for side in (dense, lazy))
            said.append(f"{library}, d = {d}, m = {m}: " + " MB dense, ".join(megabytes) + " MB lazy")
    status = NOT_TESTABLE
    if shares:
        status = NOT_REPRODUCED if min(shares.values()) < 0.2 else IN_PART if min(shares.values()) < 0.5 else REPRODUCED
    return Verdict(
        status=status,
        says=_memory_verdict_in_words(shares),
        headline=(
            f"{min(shares.values(), default=1.0):.2%}",
            "of the memory of a dense Sinkhorn is enough, in the best library",
        ),
        ours="; ".join(said) or "no lazy Sinkhorn could be run",
        tolerance=(
            "not reproduced if a lazy variant, which makes the entries of the cost matrix as they are needed, takes "
            "less than a fifth of the memory of its dense one; in part below a half"
        ),
        numbers=_by_size([row for row in memory if row["peer"].startswith("Sinkhorn")], "bytes", "MB", 1e-6)
        if shares
        else "",
    )


KINDS = ("dense", "lazy")


def _memory_verdict_in_words(shares: dict[tuple[str, int], float]) -> str:
    if not shares:
        return "No Sinkhorn with a lazy cost matrix could be run."
    library = min(shares, key=shares.get)[0]
    others = sorted({name for (name, _), share in shares.items() if share > 1} - {library})
    also = f", whereas the lazy variant of {' and '.join(others)} takes more than its dense one" if others else ""
    return f"The lazy variant of {library} takes {min(shares.values()):.2%} of the memory of its dense one{also}."


def _name(library: str, kind: str) -> str:
    return f"Sinkhorn, {library} {kind}"


def _by_size(rows: list[dict], quantity: str, unit: str, factor: float = 1.0) -> str:
    """A row for every method and dimension, a column for every size."""
    lines: dict[tuple[str, int], dict] = {}
    sizes = sorted({row["m"] for row in rows})
    for row in rows:
        line = lines.setdefault((row["peer"], row["d"]), {"peer": row["peer"], "d": row["d"]})
        line[row["m"]] = digits(factor * row[quantity], 2)
    shown = [
        {"peer": line["peer"], "d": line["d"]} | {f"m = {m} ({unit})": line.get(m, "–") for m in sizes}
        for line in lines.values()
    ]
    return markdown_table(shown)
