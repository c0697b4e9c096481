"""Claims 1, 10, 12, 18 and 20 to 22: what a descent on a loss costs, where it ends, and what it does to a mesh."""

import math
from statistics import mean, stdev

from meshot_book.claims.ledger import (
    ASSUMING,
    CHOICE,
    IN_PART,
    NOT_REPRODUCED,
    NOT_TESTABLE,
    REPRODUCED,
    Verdict,
    where,
)
from meshot_book.measurements import MAIN, grouped


def toy_verdict(record: dict) -> Verdict:
    """Claim 1: is Chamfer trapped where sliced Wasserstein is not, with the paper's optimiser?"""
    summary, rows, floors = (record["results"][key] for key in ("summary", "differences", "floors"))
    names = {
        ("chamfer", False): "Chamfer",
        ("sliced", True): "sliced Wasserstein, redrawn",
        ("sliced", False): "sliced Wasserstein, fixed",
    }
    further = [row for row in rows if row["w2_low"] > 0]
    barer = [row for row in further if row["coverage_high"] < 0]
    means = [row | {"loss": names[row["loss"], bool(row.get("redraw"))]} for row in where(summary, reduction="mean")]
    numbers = {
        "n": len(rows),
        "further": len(further),
        "barer": len(barer),
        "chamfer": where(means, sampling="even")[0],
        "sliced": where(means, sampling="even")[1],
        "others": sorted({row["polygon"] for row in further if row not in barer}),
    }
    status = REPRODUCED if len(barer) == len(rows) else IN_PART if further else NOT_REPRODUCED
    return Verdict(
        status,
        numbers,
        (means + [row | {"loss": "*two samples of the target*"} for row in floors],),
        fits=len(barer) < len(further),
    )


def speed_verdict(record: dict) -> Verdict:
    """Claim 10: does sorting scale as m log m, and is it faster than Chamfer?"""
    # A loss is faster than another at a size if the whole range of its times lies below that of the other. One call has
    # no range, and decides nothing.
    smallest = 10_000  # support points; with fewer, all losses are fast
    highest = 1.5  # the mean of the exponents of m and m²
    ours = "sliced, fused"
    cases = [row for row in record["results"]["cases"] if row["m"] >= smallest]
    own = {(row["d"], row["m"]): row for row in where(cases, peer=ours) if row["rounds"] > 1}
    duels: dict[str, list[dict]] = {}
    for short, rival in (("brute", "brute force"), ("tree", "k-d tree")):
        found = [row for row in where(cases, peer=f"Chamfer, {rival}") if row["rounds"] > 1]
        duels[short] = [
            {"d": row["d"], "m": row["m"], "ratio": row["seconds"] / mine["seconds"]}
            | {"low": row["low"] / mine["high"], "high": row["high"] / mine["low"]}
            for row in found
            if (mine := own.get((row["d"], row["m"])))
        ]
    faster = {short: [row for row in rows if row["low"] > 1] for short, rows in duels.items()}
    slower = [row for row in duels["tree"] if row["high"] < 1]
    grown = sorted(where(record["results"]["exponents"], peer=ours, quantity="seconds"), key=lambda row: row["d"])
    exponent = max(row["exponent"] for row in grown)
    scales = exponent < highest and len(faster["brute"]) == len(duels["brute"])
    numbers = {
        "exponent": exponent,
        "exponents": grown,
        "n_brute": len(duels["brute"]),
        "brute": [row["ratio"] for row in duels["brute"]],
        "n": len(duels["tree"]),
        "faster": len(faster["tree"]),
        "slower": len(slower),
        "open": len(duels["tree"]) - len(faster["tree"]) - len(slower),
        "tree": duels["tree"],
        "n_directions": record["config"]["n_directions"],
        "smallest": smallest,
        "highest": highest,
    }
    return Verdict(
        NOT_REPRODUCED if not scales else REPRODUCED if len(faster["tree"]) == len(duels["tree"]) else IN_PART,
        numbers,
        (_by_size(cases, "seconds"),),
    )


def _by_size(rows: list[dict], quantity: str) -> list[dict]:
    """A row for every method, dimension and size, without a value if it was not measured."""
    found = {(row["peer"], row["d"], row["m"]): row[quantity] for row in rows}
    methods, sizes = dict.fromkeys((peer, d) for peer, d, _ in found), sorted({m for *_, m in found})
    return [{"peer": peer, "d": d, "m": m, "value": found.get((peer, d, m))} for peer, d in methods for m in sizes]


def memory_verdict(record: dict) -> Verdict:
    """Claim 21: must the memory of Sinkhorn grow like the number of pairs of support points?"""
    # Growth decides, between the smallest and the largest size at which a variant was run. The lazy variant of OTT is
    # left out: it was run at one size only, at which its batch holds the whole matrix.
    highest = 1.5  # the mean of the exponents of m and m²
    rows = [row for row in record["results"]["memory"] if row["peer"].startswith("Sinkhorn")]
    rows = [row for row in rows if row["peer"] != "Sinkhorn, OTT lazy"]
    grown = []
    for found in grouped(sorted(rows, key=lambda row: (row["peer"], row["d"], row["m"])), ["peer", "d"]):
        first, last = found[0], found[-1]
        if first["m"] < last["m"]:
            exponent = math.log(last["bytes"] / first["bytes"]) / math.log(last["m"] / first["m"])
            about = {"variant": first["peer"].removeprefix("Sinkhorn, "), "d": first["d"], "exponent": exponent}
            grown.append(
                about | {"m": [first["m"], last["m"]], "megabytes": [row["bytes"] / 1e6 for row in (first, last)]}
            )
    dense, lazy = ([row for row in grown if row["variant"].endswith(kind)] for kind in ("dense", "lazy"))
    spared = [row for row in lazy if row["exponent"] < highest]
    status = NOT_REPRODUCED if spared else REPRODUCED
    return Verdict(
        status if lazy else NOT_TESTABLE,
        {"exponent": min((row["exponent"] for row in lazy), default=None), "lazy": lazy, "dense": dense}
        | {"grown": grown, "highest": highest},
        (_by_size([row | {"megabytes": row["bytes"] * 1e-6} for row in rows], "megabytes"),),
        fits=bool(dense) and all(row["exponent"] >= highest for row in dense),
    )


def self_intersection_verdict(record: dict, deforming: dict, ddot: dict, budget: dict) -> Verdict:
    """Claim 12: does a Lipschitz flow keep a mesh from crossing itself, as it keeps points?"""
    # The theorem applies to the points where h·Lip < 1 along the paths, by Euler, without a flip.
    safe = [
        level["most"]
        for fit in record["results"]["carried"]
        for row in where(fit["rows"], way="euler", flips=0)
        if row["step_times_lipschitz"] < 1
        for level in row["levels"].values()
    ]
    by_spacing: dict[float, list[int]] = {}  # the most crossing faces of each fit, at the end or on the way
    for row in record["results"]["fits"]:
        by_spacing.setdefault(row["spacing"], []).append(max(row["crossing"], row.get("most_on_the_way", 0)))
    free = by_spacing.pop(0.0)
    others = [int(row["end"]["intersecting_faces"]) for row in deforming["results"]["fits"]]
    fits = [most for found in by_spacing.values() for most in found] + others
    networks = [
        {"name": name, "percent": [row["flow_crossing_percent"]["mean"] for row in found]}
        for arm, name in (("ddot", "DDOT"), ("cortexode", "CortexODE"))
        if (found := where(ddot["results"]["summary"], arm=arm))
    ]
    # Longer and wider trainings: last weights, held-out subjects, before any repair.
    longer = [
        {"name": f"{budget['config']['readings'][training['arm']]['title']} after {training['n_steps']} steps"}
        | {"percent": row["crossing_percent"]["mean"]}
        for training in budget["results"]["trainings"]
        for row in where(budget["results"]["means"], arm=training["arm"], weights="last", split="test", kind=MAIN)
    ]
    shares = [percent for each in networks for percent in each["percent"]] + [each["percent"] for each in longer]
    numbers = {
        name: {"crossed": sum(map(bool, found)), "n": len(found), "most": max(found, default=0)}
        for name, found in (("fits", fits), ("free", free), ("safe", safe), ("others", others))
    }
    share, share_of_free = (numbers[name]["crossed"] / numbers[name]["n"] for name in ("fits", "free"))
    status = IN_PART if share < min(0.5, share_of_free) else NOT_REPRODUCED
    if not any(safe) and not any(fits) and not any(shares):
        status = REPRODUCED
    numbers["by_spacing"] = [
        {"spacing": spacing, "crossed": sum(map(bool, found)), "n": len(found)}
        for spacing, found in sorted(by_spacing.items(), reverse=True)
    ]
    return Verdict(status, numbers | {"networks": networks, "longer": longer}, (_crossing_rows(record),))


def _crossing_rows(record: dict) -> list[dict]:
    """A row for every pair, loss, encoding and fineness: means over the seeds."""
    names, rows = ("pair", "loss", "encoding", "spacing"), []
    for found in grouped(sorted(record["results"]["fits"], key=lambda row: [row[name] for name in names]), names):
        about, crossing = dict(found[0]), [row["crossing"] for row in found]
        n_faces = 20 * 4 ** record["config"]["pairs"][about["pair"]]["level"]
        steep = [row["step_times_lipschitz"] for row in found if "step_times_lipschitz" in row]
        about |= {"loss": {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}[about["loss"]], "n_faces": n_faces}
        about |= {"grid": f"{about['spacing']:g}" if about["spacing"] else "no flow", "n_seeds": len(found)}
        about |= {"mean": mean(crossing), "sd": stdev(crossing), "percent": 100 * mean(crossing) / n_faces}
        about |= {"steep": f"{mean(steep):.2g}" if steep else "", "assd": mean(row["assd"] for row in found)}
        rows.append(about)
    return rows


def blur_verdict(record: dict) -> Verdict:
    """Claim 18: for which blurs is the result of Sinkhorn farther away than that of slices, in both distances?"""
    fits, differences, limits = (record["results"][key] for key in ("fits", "differences", "limits"))
    names = {"sliced": "sliced Wasserstein", "exact": "exact W₂"}

    def blur(row: dict) -> str:
        return f"{row['blur_mm']:.3g}" + (f" (annealed by {row['scaling']})" if row["scaling"] != 0.5 else "")

    def named(row: dict) -> dict:
        return row | {"name": names.get(row["loss"]) or f"Sinkhorn, {blur(row)} mm"}

    tried = where(differences, loss="sinkhorn")
    weaker = [row for row in tried if row["w2_varifold_low"] > 0 and row["sw2_surface_low"] > 0]
    better = [row for row in tried if row["w2_varifold_high"] < 0 and row["sw2_surface_high"] < 0]
    unclear = [row for row in tried if row not in weaker and row not in better]
    numbers = {
        "n": len(tried),
        "n_weaker": len(weaker),
        "weaker": list(map(blur, weaker)),
        "better": list(map(blur, better)),
        "unclear": list(map(blur, unclear)),
        "lengths": record["results"]["lengths_mm"],
    }
    distances = ("w2_varifold", "sw2_surface", "assd", "emd")
    rows = [{"name": "*start*"} | {name: f"{record['results']['start'][name]:.3g}" for name in distances}]
    for row in fits:
        spreads = {name: f"{row[f'{name}_mean']:.3f} ± {row[f'{name}_sd']:.3f}" for name in distances}
        rows.append(named(row) | spreads)
    floor = {name: f"{record['results']['floor'][name]:.3f}" for name in distances}
    return Verdict(
        REPRODUCED if len(weaker) == len(tried) else CHOICE if weaker else NOT_REPRODUCED,
        numbers,
        (
            [*rows, {"name": "*the target itself*"} | floor],
            list(map(named, differences)),
            [row for row in limits if row["scaling"] in (0.5, 0.99)],
        ),
        fits=bool(better and unclear),
    )


def supports_verdict(record: dict) -> Verdict:
    """Claim 20: does memory grow with the mesh, unless the number of supports is fixed?"""
    costs, fits, differences = (record["results"][key] for key in ("costs", "fits", "differences"))
    steady = 1.1  # memory up to this multiple of that on the previous mesh counts as constant
    names = {
        "all": "all faces",
        "drawn": "drawn after the flow",
        "carried": "drawn before the flow",
        "through": "drawn after the flow, gradients through the areas",
    }
    losses = {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}
    growth, rows = {}, []
    for loss, title in losses.items():
        for variant in ("all", "drawn", "carried"):
            found = sorted(where(costs, loss=loss, variant=variant), key=lambda row: row["n_faces"])
            before, last = found[-2:]  # small meshes have shared corners
            growth[f"{loss} {variant}"] = last["step_bytes"] / before["step_bytes"]
            for row in found:
                megabytes = {part: row[f"{part}_bytes"] / 1e6 for part in ("step", "loss")}
                rows.append(row | megabytes | {"loss_name": title, "supports": names[variant]})
    grows = all(growth[f"{loss} all"] > steady for loss in losses)
    mended = all(growth[f"{loss} carried"] <= steady for loss in losses)
    numbers = {
        "growth": growth,
        "before": before["n_faces"],
        "last": last["n_faces"],
        "whole": fits[0],
        "changes": [row | {"supports": names[row["variant"]]} for row in differences],
        "steady": steady,
    }
    return Verdict(
        NOT_REPRODUCED if not grows else ASSUMING if mended else REPRODUCED,
        numbers,
        (rows, [row | {"supports": names[row["variant"]]} for row in fits]),
        fits=any(row["assd_low"] > 0 for row in where(differences, variant="carried")),
    )


def evenness_verdict(record: dict) -> Verdict:
    """Claim 22: does sliced Wasserstein leave more even triangles than Chamfer? The gaps are Chamfer minus sliced."""
    # A loss leads after equal steps, after equal seconds or at equal closeness if it is more even in more comparisons
    # than the other.
    every, measures = record["results"]["differences"], ("assd", "edge_variation", "area_variation")
    rows = [row for row in every if row["edge_variation_low"] is not None]  # several seeds

    def tally(rows: list[dict]) -> dict[str, int]:
        names = ("edge_variation", "area_variation")
        both = {end: [[row[f"{name}_{end}"] for name in names] for row in rows] for end in ("low", "high", "gap")}
        return {
            "sliced": sum(min(each) > 0 for each in both["low"]),
            "chamfer": sum(max(each) < 0 for each in both["high"]),
            "same": both["gap"].count([0, 0]),
            "n": len(rows),
        }

    tallies = {at: tally(where(rows, at=at)) for at in ("steps", "seconds", "closeness")}
    leads = [each["sliced"] > each["chamfer"] for each in tallies.values()]
    status = CHOICE if any(leads) else NOT_REPRODUCED
    if all(leads):
        status = REPRODUCED if all(each["sliced"] == each["n"] for each in tallies.values()) else IN_PART
    ended = [row for row in rows if row["at"] != "closeness"]
    numbers = tallies | {
        "first": where(rows, target="folded")[0],
        "cortex": tally([row for row in rows if row["target"] != "folded"]),
        "nearer": sum(row["assd_low"] > 0 for row in ended),
        "farther": sum(row["assd_high"] < 0 for row in ended),
        "n_ended": len(ended),
        "rates": where(record["results"]["rates"], encoding="varifold", supports="full"),
    }
    shown = [
        row | {name: {end: row[f"{name}_{end}"] for end in ("gap", "low", "high")} for name in measures}
        for row in every
    ]
    shown = [row | ({"assd": None} if row["at"] == "closeness" else {}) for row in shown]
    same = [tallies[at]["same"] > 0 for at in tallies]
    return Verdict(status, numbers, (shown,), fits=same == [False, False, True])
