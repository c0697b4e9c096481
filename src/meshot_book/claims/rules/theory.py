"""Claims 2 to 5, 11 and 24: the theorem, rates of convergence, axioms of a metric, and the ground cost."""

from meshot_book.claims.ledger import ASSUMING, IN_PART, NOT_REPRODUCED, PROVED, REPRODUCED, Verdict, fill, where

#: How far beyond the ends of a fitted interval an exponent may lie and still count as agreed: logarithms and small
#: samples move fitted slopes by about as much.
SLACK = 0.05
PAIR = "{shape:words} in R^{d} {relation}"


def theorem_verdict(record: dict) -> Verdict:
    """Claim 2: is the error at most C·R·√((d+1) log m / m), C of p and R alone?"""
    # Proofs decide: no constant of p and R alone bounds the error of the points for p > 1, and one with the joint
    # diameter does. The measurements must agree with both.
    sizes, bounds, distance = (record["results"][key] for key in ("sizes", "bounds", "distance"))
    slower = [row for row in sizes if row["high"] > row["bound_slope"]]
    pairs = [(row["p"], row["slice_error"] / row["sharper"]) for row in bounds]
    pairs += [(row["p"], error / bound) for row in distance for error, bound in zip(row["error"], row["sharper"])]
    # Apart, the error grows with the distance to the power p − 1. Concentric spheres have another rate in m, by
    # symmetry, so that multiples of their error would grow with m.
    grows = [row for row in distance if _holds(row, row["p"] - 1)]
    most = max(where(distance, p=2), key=lambda row: row["n_points"])  # 2 is the paper's exponent
    shown = [row for row in sizes if row["pair"] in ("generic", "equal")]
    shown += [row for row in where(sizes, p=2) if row["pair"] in ("disconnected", "concentric")]
    keys = ("apart", "error", "sharper")
    numbers = {
        "n": len(sizes),
        "holds": len(sizes) - len(slower),
        "slopes": shown,
        "most": most,
        "growth": most["error"][-1] / most["error"][1],
        "apart": [most["apart"][1], most["apart"][-1]],
        "in_distance": sorted(where(distance, n_points=most["n_points"]), key=lambda row: row["p"]),
        "shares": [
            {"p": p, "share": max(share for each, share in pairs if each == p)} for p in sorted({p for p, _ in pairs})
        ],
        "slack": SLACK,
    }
    return Verdict(
        PROVED,
        numbers,
        (
            [row | {"fewest": row["n_repetitions"][-1]} for row in sizes],
            [
                row | {key: row[key][k] for key in keys} | {"share": row["error"][k] / row["sharper"][k]}
                for row in distance
                for k in range(len(row["apart"]))
            ],
        ),
        fits=not slower and len(grows) == len(distance) and all(share <= 1 for _, share in pairs),
    )


def transport_rate_verdict(record: dict) -> Verdict:
    """Claim 3: SW like m^(-1/2) in every dimension, and the error of W at most of the order m^(-1/d)?"""
    # The paper's inequality for W is an upper bound, which an error of a faster rate obeys as well.
    transport, every = (record["results"][key] for key in ("transport", "sliced"))
    sliced = [row for row in every if row["expected"] is not None]  # connected, no symmetry: theory gives −½
    rest = where(every, expected=None)
    agreed = [row for row in sliced if _holds(row, row["expected"])]
    cases: dict[str, list[dict]] = {"follows": [], "undecided": [], "faster": [], "slower": []}
    for row in transport:
        stated, theory = -1 / row["d"], -0.5 if row["expected"] is None else row["expected"]
        if not _holds(row, stated):
            cases["faster" if row["high"] < stated else "slower"].append(row)
        else:
            both = abs(stated - theory) > SLACK and _holds(row, theory)
            cases["undecided" if both else "follows"].append(row)
    # Theory contradicts the bound if its exponent is closer to zero. The measurement must agree, without the slack.
    breaks = [
        row
        for row in transport
        if row["expected"] is not None and row["expected"] > -1 / row["d"] + SLACK and row["low"] > -1 / row["d"]
    ]
    status = NOT_REPRODUCED if cases["slower"] else ASSUMING if breaks else REPRODUCED
    beside = {(row["shape"], row["d"], row["relation"], row["p"]): row for row in every}
    numbers = {
        "n_sliced": len(sliced),
        "n_agreed": len(agreed),
        "slopes": [row["slope"] for row in sliced],
        "slowest": max(rest, key=lambda row: row["slope"]),
        "rest": rest,
        "n": len(transport),
        "obeys": len(transport) - len(cases["slower"]),
        "breaks": breaks,
        "counts": {name: len(found) for name, found in cases.items()},
        "names": {name: list(dict.fromkeys(fill(PAIR, row) for row in found)) for name, found in cases.items()},
        "slack": SLACK,
    }
    rows = [
        row | {"stated": -1 / row["d"], "sliced": beside[row["shape"], row["d"], row["relation"], row["p"]]}
        for row in transport
    ]
    return Verdict(
        status if len(agreed) == len(sliced) else NOT_REPRODUCED,
        numbers,
        (rows,),
        fits=sum(row["low"] > -0.5 for row in rest) == 1,
    )


def _holds(row: dict, exponent: float) -> bool:
    """Whether the interval of a fitted slope, widened by :data:`SLACK`, holds an exponent."""
    return row["low"] - SLACK <= exponent <= row["high"] + SLACK


def chamfer_rate_verdict(record: dict) -> Verdict:
    """Claim 4: does sampled Chamfer lack a rate of convergence? Solids do not count: the claim is about meshes."""
    rows = record["results"]["chamfer"]
    limits = {(row["shape"], row["d"], row["relation"]): row for row in record["results"]["limits"]}
    surfaces = [row for row in rows if row["dimension"] == 2 and row["shape"] != "cube"]
    fast = [row for row in surfaces if row["high"] <= -0.5 + SLACK]
    numbers = {
        "n": len(surfaces),
        "fast": len(fast),
        "equal": [row["slope"] for row in surfaces if row["relation"] in ("equal", "other_density")],
        "other": [row["slope"] for row in where(surfaces, relation="other_surface")],
        "solids": [row["slope"] for row in where(rows, relation="equal") if row not in surfaces],
        "slack": SLACK,
    }
    last = [{"m": row["sizes"][-1], "error": row["error"][-1]} for row in rows]
    return Verdict(
        NOT_REPRODUCED if len(fast) == len(surfaces) else IN_PART if fast else REPRODUCED,
        numbers,
        ([limits[row["shape"], row["d"], row["relation"]] | row | end for row, end in zip(rows, last)],),
    )


def directions_verdict(record: dict) -> Verdict:
    """Claim 5: is the error over random directions √(Var/L)?"""
    rows = record["results"]["directions"]
    # With fewer directions, a few draws from the heavy tail of the costs dominate the error.
    slope_tolerance, constant_tolerance, fewest = 0.02, 0.05, 10
    off = [row for row in rows if max(abs(row[end] + 0.5) for end in ("low", "high")) > slope_tolerance]
    each = [(row, n, ratio) for row in rows for n, ratio in zip(row["counts"], row["constant"], strict=True)]
    constants = [ratio for _, n, ratio in each if n >= fewest]
    farthest = max(abs(ratio - 1) for ratio in constants)
    numbers = {
        "n": len(rows),
        "holds": len(rows) - len(off),
        "farthest": farthest,
        "slopes": [row["slope"] for row in rows],
        "constants": constants,
        "absolute": [row["absolute_over_rms"][-1] for row in rows],
        "slope_tolerance": slope_tolerance,
        "constant_tolerance": constant_tolerance,
        "fewest": fewest,
    }
    return Verdict(
        NOT_REPRODUCED if off else IN_PART if farthest > constant_tolerance else REPRODUCED,
        numbers,
        (
            [
                row | {"sd": row["variance"] ** 0.5, "L": n, "constant": ratio}
                for row, n, ratio in each
                if n in row["counts"][::2]
            ],
        ),
    )


def axioms_verdict(record: dict) -> Verdict:
    """Claim 11: is sliced Wasserstein a metric, which Sinkhorn and Chamfer are not?"""
    # Proofs and counterexamples decide. The measurements must agree with them.
    triangles, ghosts, sequences = (record["results"][key] for key in ("triangles", "ghosts", "sequences"))
    tolerance = record["config"]["tolerance"]
    metrics = [row for row in triangles if row["loss"] in ("SW₁", "SW₂", "W₁", "W₂")]
    others = [row for row in where(triangles, root=True) if row not in metrics]
    kept = all(row["n_broken"] == 0 and row["largest_found"] <= 1 + tolerance for row in metrics)
    breaks = all(row["largest_found"] > 1.01 for row in others)
    # Among bounded sequences, a loss should tend to zero exactly along those that converge weakly.
    wrong = {row["loss"] for row in where(sequences, bounded=True) if row["tends_to_zero"] != row["converges_weakly"]}
    weak = not wrong & {"SW₁", "SW₂"} and "root of Chamfer" in wrong
    found = [row for row in ghosts if row["own"] < 1e-9 < 1e-2 < row["w2"]]
    numbers = {
        "n_triples": metrics[0]["n_triples"],
        "ghosts": len(found),
        "n_ghosts": len(ghosts),
        "others": others,
        "tolerance": tolerance,
    }
    return Verdict(
        PROVED,
        numbers,
        (triangles, ghosts, [row | {"last": row["values"][-1]} for row in sequences]),
        fits=kept and breaks and weak and len(found) == len(ghosts),
    )


def ground_cost_verdict(record: dict) -> Verdict:
    """Claim 24: is the cost of transport the sum of p-th powers over coordinates?"""
    # By definition, both costs are equal for p = 2 and for no other exponent. The measurements must agree.
    rows, asked = record["results"]["summary"], record["results"]["asked"]
    agrees = 0.01  # the error of solvers and of finitely many directions
    same = [row for row in rows if abs(row["ratio_mean"] - 1) < agrees]
    others = [row for row in rows if row not in same]
    numbers = {
        "same": [row["p"] for row in same],
        "others": [row["p"] for row in others],
        "farthest": max(rows, key=lambda row: abs(row["ratio_mean"] - 1)),
        "differ": others,
        "euclidean": sum(abs(row["diagonal_over_axis"] - 1) < agrees for row in asked),
        "n_asked": len(asked),
        "agrees": agrees,
    }
    return Verdict(PROVED, numbers, (rows, asked), fits=bool(others) and [row["p"] for row in same] == [2])
