"""Claims 6 to 9, 15 and 23: how a mesh becomes a measure, and what its samples are good for."""

from statistics import mean

from meshot_book.claims.ledger import CHOICE, IN_PART, NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, Verdict, ends, where
from meshot_book.measurements import grouped


def continuous_verdict(record: dict) -> Verdict:
    """Claim 6: is the continuous encoding of theoretical use only?"""
    accuracy, sampling, descent = (record["results"][key] for key in ("accuracy", "sampling", "descent"))
    roundoff, by_differences, close = 1e-11, 1e-5, 0.1
    error = max(row["error"] for row in accuracy["values"])
    slope_error = max(row["largest_relative_error"] for row in accuracy["gradients"])
    ratio = record["results"]["time"]["ratio_to_exact"]["100000 points"]
    runs = where(descent, encoding="continuous")
    left = max(row["end"]["sliced_distance"] / row["start"]["sliced_distance"] for row in runs)
    accurate = error <= roundoff and slope_error <= by_differences
    sampled = [row | each for row in sampling for each in row["sampled"]]
    numbers = {
        "ratio": ratio,
        "left": left,
        "error": error,
        "slope_error": slope_error,
        "sampled": [row["rms_error"] for row in where(sampled, n_points=100_000)],
        "roundoff": roundoff,
        "by_differences": by_differences,
        "close": close,
    }
    descents = []
    for found in grouped(descent, ["encoding"]):
        row = {"encoding": found[0]["encoding"], "runs": len(found)}
        for key in ("sliced_distance", "surface_distance"):
            values = [each["end"][key] for each in found]
            row |= {key: values, f"{key}_mean": mean(values)}
        descents.append(row)
    useful = accurate and ratio > 1 and left < close
    return Verdict(NOT_REPRODUCED if useful else IN_PART if accurate else REPRODUCED, numbers, (sampled, descents))


def varifold_verdict(record: dict) -> Verdict:
    """Claim 7: does the varifold approximate a mesh better than samples do, at equal numbers of support points?"""
    rates, duels = record["results"]["rates"], record["results"]["duels"]
    won, lost = [row for row in duels if row["low"] > 1], [row for row in duels if row["high"] < 1]
    own = [row for row in where(rates, quantity="own") if row["family"] != "uneven_cube"]
    quantities = {"own": "to its own mesh, SW_p", "other": "to another mesh, SW_p^p"}
    encodings = {"barycentres": "varifold", "samples": "samples"}
    numbers = {
        "n": len(duels),
        "won": len(won),
        "lost": len(lost),
        "open": len(duels) - len(won) - len(lost),
        "where": list(dict.fromkeys(row["family"] for row in lost)),
        "largest": max(duels, key=lambda row: row["low"]),
    }
    for encoding, name in encodings.items():
        numbers[name] = ends(row["slope"] for row in where(own, encoding=encoding))
    shown = [
        row | {"error": quantities[row["quantity"]], "encoding": encodings[row["encoding"]]}
        for row in rates
        if row["encoding"] in encodings
    ]
    others = [row | {"quantity": row["quantity"].replace("other", "another")} for row in duels]
    status = REPRODUCED if len(won) == len(duels) else IN_PART if won else NOT_REPRODUCED
    return Verdict(status, numbers, (shown, others), fits=bool(lost))


def normal_scale_verdict(record: dict) -> Verdict:
    """Claim 8: can positions and unit normals share one space, in any unit?"""
    rows = record["results"]["pairs"]
    # The first pair of each control differs in positions only, the other in normals only.
    pairs = [row for row in rows if row["pair"] not in ("white and shifted", "white and inside out")]
    in_mm, in_box = ([_at(row, scale or row["half_extent"]) for row in pairs] for scale in (1.0, None))
    scales = [
        scale
        for scale in (each["scale"] for each in pairs[0]["rows"])
        if all(_at(row, scale)["scale"] == scale and _both(_at(row, scale)) for row in pairs)
    ]
    status = REPRODUCED if all(map(_both, in_mm + in_box)) else CHOICE if scales else NOT_REPRODUCED
    numbers = {"scales": scales}
    for name, found in (("mm", in_mm), ("box", in_box)):
        numbers |= {name: [100 * each["share"] for each in found]}
        numbers |= {f"{name}_gradient": [100 * each["gradient_share"] for each in found]}
    units = [
        row | {"unit": unit, "part": part, "of_part": _at(row, scale)[key]}
        for row in rows
        for unit, scale in (("1 mm", 1.0), ("10 mm", 10.0), ("[-1, 1]", row["half_extent"]))
        for part, key in (("value", "share"), ("gradient", "gradient_share"))
    ]
    return Verdict(status, numbers, (units,))


def _at(row: dict, scale: float) -> dict:
    """The entry for the scale of the normals that is nearest."""
    return min(row["rows"], key=lambda each: abs(each["scale"] - scale))


def _both(each: dict) -> bool:
    """Whether positions and normals have a twentieth of the gradient at least."""
    return 0.05 <= each["gradient_share"] <= 0.95


def weights_verdict(record: dict) -> Verdict:
    """Claim 9: is transport between unequal weights correct, and must gradients pass through the areas?"""
    merging, rows, gradients = (record["results"][key] for key in ("merging", "differences", "gradients"))
    largest_error = 1e-12
    libraries = ("pot_sorting", "pot_linear_program", "scipy")
    worst = max(row[name] for row in merging for name in libraries if name in row)
    nearer = [row for row in rows if row["sw_surface_low"] > 0]  # with gradients through the areas
    farther = [row for row in rows if row["sw_surface_high"] < 0]
    encodings = [
        {"encoding": name, "n": len(where(rows, encoding=name)), "nearer": len(where(nearer, encoding=name))}
        | {"farther": len(where(farther, encoding=name))}
        for name in dict.fromkeys(row["encoding"] for row in rows)
    ]
    numbers = {
        "worst": worst,
        "n_cases": sum(row["n_cases"] for row in merging),
        "changed": len(nearer) + len(farther),
        "n": len(rows),
        "encodings": encodings,
        "full": mean(row["tangential_full_mean"] for row in gradients),
        "stopped": mean(row["tangential_stopped_mean"] for row in gradients),
        "blind": record["results"]["areas"][0],
        "largest_error": largest_error,
    }
    return Verdict(
        NOT_REPRODUCED if worst > largest_error else CHOICE if nearer or farther else REPRODUCED, numbers, (rows,)
    )


def floor_verdict(record: dict) -> Verdict:
    """Claim 15: does an EMD of .70 mm measure the quality of a surface?"""
    # It does under a reading (which distance, which root) whose floor, from two samples of one surface, is at most half
    # the number. Squares are additive, so that three quarters of its square are then due to the surfaces. An interval
    # that contains the half decides nothing.
    readings, number = record["results"]["readings"], record["results"]["number_mm"]
    usable = [row for row in readings if row["high"] <= 0.5 * number]
    useless = [row for row in readings if row["low"] > 0.5 * number]
    floors = []
    names = {"sw2": "SW₂", "point_to_point": "ASSD to the nearest point", "point_to_face": "ASSD to the faces"}
    for metric, name in names.items():
        rows = [row["at_target"] for row in where(record["results"]["floors"], metric=metric)]
        found = [row["measured"] for row in rows if "measured" in row]
        low, high = min(row["low"] for row in found), max(row["high"] for row in found)
        shown = f"{low:.3g} to {high:.3g}" if high > 1e-9 else "0 (rounding)"
        floors.append({"metric": name, "first": found[0], "shown": shown})
    numbers = {
        "exact": readings[0],
        "sliced": floors[0]["first"],
        "number": number,
        "beyond": sum(row["low"] >= number for row in readings),
        "usable": len(usable),
        "useless": len(useless),
        "undecided": [row["reading"] for row in readings if row not in usable and row not in useless],
        "n": len(readings),
    }
    status = REPRODUCED if len(usable) == len(readings) else CHOICE
    if not usable:
        status = NOT_REPRODUCED if useless else NOT_TESTABLE
    return Verdict(status, numbers, (readings, floors))


def sample_gradient_verdict(record: dict) -> Verdict:
    """Claim 23: can a mesh be optimised through points sampled from it?"""
    rows, descent = record["results"]["curve"] + record["results"]["losses"], record["results"]["descent"]
    biased = [row for row in rows if not row["fixed_draws"]["low"] <= row["exact"] <= row["fixed_draws"]["high"]]
    places = dict.fromkeys((row["kind"], row["n_corners"]) for row in descent)
    ends = {
        place: mean(row["sliced_distance"] for row in where(descent, kind=place[0], n_corners=place[1]))
        for place in places
    }
    few, close = min(n for _, n in places), 0.1  # with few corners, a descent cannot reach its target
    best, sampled = ends["continuous", few], ends["samples, fixed draws", few]
    numbers = {
        "n": len(rows),
        "biased": len(biased),
        "shares": [row["fixed_draws"]["mean"] / row["exact"] for row in rows],
        "curve": rows[0],
        "sampled": sampled,
        "best": best,
        "close": close,
    }
    status = NOT_REPRODUCED if sampled > (1 + close) * best else CHOICE if biased else REPRODUCED
    return Verdict(status, numbers, (rows, [{"kind": k, "n": n, "end": end} for (k, n), end in ends.items()]))
