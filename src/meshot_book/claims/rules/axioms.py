"""Claim 11: sliced Wasserstein is a metric, Sinkhorn violates the triangle inequality, Chamfer is a pseudo-distance."""

from meshot_book.claims import ledger
from meshot_book.notebook import digits, markdown_table

METRICS = ("SW₁", "SW₂", "W₁", "W₂")
CLEARLY = 1.01


def axioms_verdict(record: dict) -> ledger.Verdict:
    """The verdict on claim 11 from ``experiments/axioms/results.json``."""
    results = record["results"]
    found = {row["loss"]: row for row in results["triangles"]}
    within = 1 + record["config"]["tolerance"]
    kept = all(found[name]["n_broken"] == 0 and found[name]["largest_found"] <= within for name in METRICS)
    broken = [name for name, row in found.items() if row["root"] and name not in METRICS]
    all_break = all(found[name]["largest_found"] > CLEARLY for name in broken)
    weak = {name: _agrees_with_weak_convergence(results["sequences"], name) for name in ("SW₁", "SW₂")}
    chamfer_blind = not _agrees_with_weak_convergence(results["sequences"], "root of Chamfer")
    ghosts = [row for row in results["ghosts"] if row["own"] < 1e-9 < 1e-2 < row["w2"]]
    holds = kept and all_break and all(weak.values()) and chamfer_blind
    status = ledger.NOT_REPRODUCED if not holds else ledger.ASSUMING if ghosts else ledger.REPRODUCED
    return ledger.Verdict(
        status=status,
        says=(
            f"Over {found['SW₂']['n_triples']} triples and a search SW and W satisfy the triangle inequality, and "
            "Sinkhorn and Chamfer violate it; with finitely many directions, however, SW is zero between different "
            f"measures in {len(ghosts)} of {len(results['ghosts'])} constructions."
        ),
        headline=(
            f"{len(ghosts)} of {len(results['ghosts'])}",
            "pairs with SW zero over finitely many directions",
        ),
        ours=_sentence(found, broken, ghosts, results["ghosts"], kept, weak, chamfer_blind),
        tolerance=(
            "reproduced if, on p-th roots, no triple, random or found by search, has under SW and W "
            f"a side longer than the two others by more than a share of {record['config']['tolerance']:g}, Sinkhorn "
            "and Chamfer have one longer by 1 % or more, SW tends to zero along those bounded sequences that converge "
            "weakly and no others, and Chamfer does so along another; under a further assumption (all directions) if "
            "different measures were found at SW zero over the directions taken"
        ),
        numbers=_tables(results),
    )


def _agrees_with_weak_convergence(sequences: list[dict], name: str) -> bool:
    """Whether, among bounded sequences, the loss converges to zero exactly for those that converge weakly."""
    rows = [row for row in sequences if row["loss"] == name and row["bounded"]]
    return all(row["tends_to_zero"] == row["converges_weakly"] for row in rows)


def _sentence(
    found: dict, broken: list[str], ghosts: list[dict], tried: list[dict], kept: bool, weak: dict, blind: bool
) -> str:
    worst = "; ".join(f"{name}: {digits(found[name]['largest_found'], 3)}" for name in broken)
    n_triples = found["SW₂"]["n_triples"]
    parts = [
        f"longest side over the sum of the others, at most: {'no more than 1' if kept else 'above 1 somewhere'} for SW "
        f"and W ({n_triples} random triples, and a local search from the worst); {worst}"
    ]
    agreeing = [name for name, agrees in weak.items() if agrees]
    parts.append(f"zero along weakly convergent bounded sequences only: {', '.join(agreeing) or 'neither SW₁ nor SW₂'}")
    parts.append(f"Chamfer is {'zero' if blind else 'not zero'} along one that does not converge")
    shares = f"{len(ghosts)} of {len(tried)} constructions"
    parts.append(f"over finitely many directions SW is zero between different measures in {shares}")
    return "; ".join(parts)


def _tables(results: dict) -> str:
    triangles = [
        {
            "loss": row["loss"],
            "triples drawn": row["n_triples"],
            "broken": row["n_broken"],
            "largest ratio drawn": row["largest_drawn"],
            "largest ratio found": row["largest_found"],
        }
        for row in results["triangles"]
    ]
    ghosts = [
        {
            "d": row["d"],
            "directions": row["n_directions"],
            "points on either side": row["n_points"],
            "SW₂ over them": f"{row['own']:.0e}",
            "SW₂ over 1000 others": row["others"],
            "W₂": row["w2"],
        }
        for row in results["ghosts"]
    ]
    sequences = [
        {
            "sequence": row["sequence"],
            "converges weakly": _yes(row["converges_weakly"]),
            "loss": row["loss"],
            "first": row["values"][0],
            "last": row["values"][-1],
            "tends to zero": _yes(row["tends_to_zero"]),
        }
        for row in results["sequences"]
    ]
    return "\n\n".join(markdown_table(rows) for rows in (triangles, ghosts, sequences))


def _yes(value: bool) -> str:
    return "yes" if value else "no"
