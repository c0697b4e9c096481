"""Claim 7: the varifold against samples of the same size, with the exact continuous value as reference."""

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table


def varifold_verdict(record: dict) -> Verdict:
    """Claim 7 from ``experiments/encoding_rates``: does the varifold approximate a mesh better than samples do?

    A comparison (a "duel" in the results) is a mesh (family and level), a space, an exponent and a quantity (error of
    SW_p^p to another mesh; SW_p to the mesh itself), with equal numbers of support points. The varifold is better if
    the 95 % interval of the ratio of mean errors, samples over varifold, is above one, and worse if it is below one.
    """
    results = record["results"]
    won = [row for row in results["duels"] if row["low"] > 1]
    lost = [row for row in results["duels"] if row["high"] < 1]
    status = IN_PART if won else NOT_REPRODUCED
    if len(won) == len(results["duels"]):
        status = REPRODUCED
    return Verdict(
        status=status,
        says=(
            f"At equal numbers of supports the varifold has the smaller error in {len(won)} of {len(results['duels'])} "
            f"comparisons and the larger one in {len(lost)}{_where(lost)}."
        ),
        headline=(f"{len(won)} of {len(results['duels'])}", "comparisons in which the varifold has the smaller error"),
        ours=_sentence(results, won, lost),
        tolerance=(
            "reproduced if at equal numbers of supports the 95 % interval of (mean error of samples) / (mean error of "
            "the varifold) lies above 1 in every comparison (mesh × space × p × quantity); in part if in some"
        ),
        numbers="\n\n".join([_rate_table(results["rates"]), _duel_table(results["duels"])]),
    )


def _sentence(results: dict, won: list[dict], lost: list[dict]) -> str:
    n_duels = len(results["duels"])
    even = [row for row in results["rates"] if row["family"] != "uneven_cube"]
    own = _range([row for row in even if row["quantity"] == "own" and row["encoding"] == "barycentres"])
    sampled = _range([row for row in even if row["quantity"] == "own" and row["encoding"] == "samples"])
    largest = max(results["duels"], key=lambda row: row["low"])
    text = (
        f"the varifold has the smaller error in {len(won)} of {n_duels} comparisons, the larger in {len(lost)}, and "
        f"{n_duels - len(won) - len(lost)} are undecided; SW_p to its own mesh falls with the edge length h like "
        f"{own}, that of samples like {sampled}; the "
        f"largest advantage is a factor of {digits(largest['ratio'], 2)} "
        f"({_name(largest)}, {largest['n_faces']} supports)"
    )
    if lost:
        text += f"; larger error: {', '.join(dict.fromkeys(_name(row) for row in lost))}"
    return text


def _where(lost: list[dict]) -> str:
    return f", all on the {', '.join(dict.fromkeys(map(_name, lost)))}" if lost else ""


def _name(row: dict) -> str:
    return row["family"].replace("_", " ")


def _range(rows: list[dict]) -> str:
    slopes = sorted(row["slope"] for row in rows)
    return f"h^{slopes[0]:.2f} to h^{slopes[-1]:.2f}"


def _rate_table(rates: list[dict]) -> str:
    """Slopes in the edge length, a row for each family, space, exponent and quantity."""
    lines: dict[tuple, dict] = {}
    for row in rates:
        if row["encoding"] not in ("barycentres", "samples"):
            continue
        what = "to another mesh, SW_p^p" if row["quantity"] == "other" else "to its own mesh, SW_p"
        line = lines.setdefault(
            (row["family"], row["d"], row["p"], row["quantity"]),
            {"mesh": _name(row), "space": f"R^{row['d']}", "p": row["p"], "error": what},
        )
        title = "varifold: slope in h" if row["encoding"] == "barycentres" else "samples: slope in h"
        line[title] = f"{row['slope']:.2f} [{row['low']:.2f}, {row['high']:.2f}]".replace("-", "−")
    return markdown_table(list(lines.values()))


def _duel_table(duels: list[dict]) -> str:
    """Ratios of errors, a row for each mesh."""
    lines: dict[tuple, dict] = {}
    for row in duels:
        line = lines.setdefault((row["family"], row["level"]), {"mesh": _name(row), "supports": row["n_faces"]})
        title = f"R^{row['d']}, p = {row['p']}, {'another' if row['quantity'] == 'other' else 'own'}"
        line[title] = f"{digits(row['ratio'], 2)} [{digits(row['low'], 2)}, {digits(row['high'], 2)}]"
    return markdown_table(list(lines.values()))
