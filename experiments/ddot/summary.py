"""Summary over hemispheres: means, paired differences over subjects and over seeds, and targets."""

import itertools
from collections.abc import Iterable

import numpy as np

from meshot.statistics import bootstrap_interval, paired_interval
from meshot_book.measurements import MAIN, grouped, spread

INITIAL = "initial"
DISTANCES = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm")
COMPARED = (*DISTANCES, "normals", "flow_crossing_percent")
FIRST_SEED = 0
SECONDS = ("cpu_seconds_flow", "cpu_seconds_repair")


def summarised(rows: list[dict], settings: dict, comparison: dict) -> dict:
    """All statistics of the rows, and the rows. ``comparison`` names our arm, its rival and others."""
    main = [row for row in rows if row["kind"] == MAIN]
    return {
        "targets": targets(main, settings["targets"], comparison),
        "differences": differences(main, settings, comparison),
        "seeds": seeds(main, comparison),
        "summary": [_group(part) for part in grouped(rows, ("cohort", "side", "arm", "seed", "kind"))],
        "subjects": rows,
    }


def numbers(row: dict) -> dict[str, float]:
    """The compared numbers: metrics of the repaired surface, and the share of intersecting faces before repair."""
    if row["arm"] == INITIAL:
        return row["measured"] | {"flow_crossing_percent": row["measured"]["crossing_percent"]}
    return row["repaired"] | {"flow_crossing_percent": row["flow"]["crossing_percent"]}


def _group(rows: list[dict]) -> dict:
    """Mean and standard deviation over subjects, for one arm, seed and kind."""
    first, values = rows[0], [numbers(row) for row in rows]
    found = {key: first[key] for key in ("cohort", "side", "arm", "seed", "kind")} | {"n_subjects": len(rows)}
    found |= {key: spread([value[key] for value in values]) for key in COMPARED}
    found["n_subjects_crossing"] = sum(value["crossing_faces"] > 0 for value in values)
    found["n_subjects_no_sphere"] = sum(value["euler_number"] != 2 for value in values)
    found |= {key: _means([value[key] for value in values]) for key in ("by_depth", "by_curvature")}
    if first["arm"] == INITIAL:
        share = {key: _means([row["share"][key] for row in rows]) for key in ("by_depth", "by_curvature")}
        floors = {key: float(np.mean([row["floors"][key] for row in rows])) for key in first["floors"]}
        return found | {"floors": floors, "share_of_area": share}
    found["n_subjects_crossing_before"] = sum(row["flow"]["crossing_faces"] > 0 for row in rows)
    found["assd_before_repair_mm"] = spread([row["flow"]["assd_mm"] for row in rows])
    found["largest_move_mm"] = max(row["largest_move_mm"] for row in rows)
    return found | {key: float(np.mean([row[key] for row in rows])) for key in SECONDS}


def _means(lists: list[list[float | None]]) -> list[float | None]:
    """The mean of each bin over the subjects whose bin is not empty."""
    columns = [[value for value in column if value is not None] for column in zip(*lists, strict=True)]
    return [float(np.mean(column)) if column else None for column in columns]


def differences(rows: list[dict], settings: dict, comparison: dict) -> list[dict]:
    """First minus second arm at the first seed, paired over subjects: flows and their start, our arm and others.

    Other compared arms are also compared with the rival. ``side`` is "both" for the mean of the two sides of a subject.
    The interval contains 95 % of the means of resampled subjects (percentiles). With eight subjects it is about a fifth
    too narrow.
    """
    found = []
    for part in grouped(rows, ("cohort",)):
        by_arm = _by_arm(part)
        for (first, second), side in itertools.product(_pairs(by_arm, comparison), ("left", "right", "both")):
            one, other = (by_arm[arm].get(side, {}) for arm in (first, second))
            subjects = [subject for subject in one if subject in other]
            if len(subjects) > 1:
                about = {"cohort": part[0]["cohort"], "side": side, "first": first, "second": second}
                gaps = {key: resampled([one[s][key] - other[s][key] for s in subjects], settings) for key in COMPARED}
                found.append(about | {"n_subjects": len(subjects)} | gaps)
    return found


def _by_arm(rows: list[dict]) -> dict[str, dict[str, dict[str, dict]]]:
    """The numbers by arm, side and subject, for the first seed. A side is "both" for the mean of the two."""
    found: dict[str, dict[str, dict[str, dict]]] = {}
    for row in rows:
        if row["seed"] in (None, FIRST_SEED):
            found.setdefault(row["arm"], {}).setdefault(row["side"], {})[row["subject"]] = numbers(row)
    for sides in found.values():
        left, right = sides.get("left", {}), sides.get("right", {})
        shared = [subject for subject in left if subject in right]
        sides["both"] = {s: {key: (left[s][key] + right[s][key]) / 2 for key in COMPARED} for s in shared}
    return found


def _pairs(arms: Iterable[str], comparison: dict) -> list[tuple[str, str]]:
    ours, rival = comparison["ours"], comparison["rival"]
    flows = [arm for arm in arms if arm != INITIAL]
    pairs = [(ours, arm) for arm in flows if arm != ours] + [(arm, rival) for arm in comparison["also"]]
    pairs += [(arm, INITIAL) for arm in flows]
    return [pair for pair in pairs if set(pair) <= {INITIAL, *flows}]


def resampled(gaps: list[float], settings: dict) -> dict[str, float]:
    """The mean of paired differences, with the interval of 95 % of the means of resampled differences."""
    gap, low, high = bootstrap_interval(gaps, n_draws=settings["n_resamples"], generator=settings["seed"])
    return {"gap": gap, "low": low, "high": high}


def seeds(rows: list[dict], comparison: dict) -> list[dict]:
    """Means over subjects for each seed, for pairs of arms with several seeds, and the interval of the difference.

    The interval is Student's for pairs: equal seeds have the same initial weights and the same order of subjects.
    """
    found, arms = [], (comparison["ours"], comparison["rival"])
    for part in grouped([row for row in rows if row["arm"] in arms], ("cohort", "side")):
        means: dict[str, dict[int, dict[str, float]]] = {arm: {} for arm in arms}
        for same in grouped(part, ("arm", "seed")):
            values = {key: float(np.mean([numbers(row)[key] for row in same])) for key in COMPARED}
            means[same[0]["arm"]][same[0]["seed"]] = values
        first, second = means.values()
        if len(shared := sorted(first.keys() & second.keys())) > 1:
            line = {"cohort": part[0]["cohort"], "side": part[0]["side"], "seeds": shared}
            for key in COMPARED:
                values = {arm: [own[seed][key] for seed in shared] for arm, own in means.items()}
                interval = dict(zip(("gap", "low", "high"), paired_interval(*values.values())))
                line[key] = {arm: spread(own) for arm, own in values.items()} | interval
            found.append(line)
    return found


def targets(rows: list[dict], wanted: dict, comparison: dict) -> list[dict]:
    """The targets for each cohort and side, and the means over subjects of our arm, its rival and the others."""
    found = []
    for part in grouped(rows, ("cohort", "side")):
        by_arm = {arm: sides[part[0]["side"]] for arm, sides in _by_arm(part).items()}
        about = {key: part[0][key] for key in ("cohort", "side")}
        for arm in (comparison["ours"], comparison["rival"], *comparison["also"]):
            if arm in by_arm:
                found.append(about | {"arm": arm} | _reached(by_arm[arm], by_arm[INITIAL], wanted))
    return found


def _reached(reached: dict[str, dict], initial: dict[str, dict], wanted: dict) -> dict:
    subjects = list(reached)
    mean, begun = (
        {key: float(np.mean([part[s][key] for s in subjects])) for key in COMPARED} for part in (reached, initial)
    )
    share = mean["assd_mm"] / begun["assd_mm"]
    each = [reached[s]["assd_mm"] <= wanted["share_of_initial"] * initial[s]["assd_mm"] for s in subjects]
    return {
        "n_subjects": len(subjects),
        "assd_mm": mean["assd_mm"],
        "share_of_initial": share,
        "normals": mean["normals"],
        "enough_of_initial": share <= wanted["share_of_initial"],
        "n_subjects_enough_of_initial": sum(each),
        "assd_reached": mean["assd_mm"] <= wanted["assd_mm"],
        "better_than_initial": {
            "swd_mm": mean["swd_mm"] < begun["swd_mm"],
            "hausdorff90_mm": mean["hausdorff90_mm"] < begun["hausdorff90_mm"],
            "normals": mean["normals"] > begun["normals"],
        },
        "n_subjects_crossing": sum(reached[s]["crossing_faces"] > 0 for s in subjects),
        "stretch_assd_reached": mean["assd_mm"] <= wanted["stretch_assd_mm"],
        "stretch_normals_reached": mean["normals"] >= wanted["stretch_normals"],
    }
