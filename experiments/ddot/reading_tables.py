"""Tables of a protocol of readings: means, paired differences over held-out subjects, and which losses help."""

from reading_rows import START, WHICH

from meshot_book.measurements import COMPARED, MAIN, METRICS, grouped, paired_gaps, spread

LOSSES = ("loss_before", "loss_after")


def tables(rows: list[dict], readings: dict[str, dict], rival: str) -> dict:
    """Means, differences, and for every reading whether its loss helps, and whether it beats its rival.

    ``rival`` is the rival of readings that name none.
    """
    rivals = {name: each.get("rival", rival) for name, each in readings.items()}
    held_out = [row for row in rows if (row["split"], row["kind"]) == ("test", MAIN)]
    gaps = differences(held_out, rivals)
    found = decided(gaps, {(row["arm"], row["weights"]) for row in held_out if "failed" in row})
    return {"means": [_mean(part) for part in grouped(rows, _PLACE)], "differences": gaps, "decided": found}


_PLACE = ("start", "arm", "weights", "split", "kind")


def _mean(rows: list[dict]) -> dict:
    there = [row for row in rows if "failed" not in row]
    about = {key: rows[0][key] for key in _PLACE} | {"n_subjects": len(there), "n_failed": len(rows) - len(there)}
    names = [key for key in (*METRICS, *LOSSES) if there and key in there[0]]
    return about | {key: spread([row[key] for row in there]) for key in names}


def differences(rows: list[dict], rivals: dict[str, str]) -> list[dict]:
    """Every reading minus its start, and minus its rival with the same kind of weights, paired over subjects."""
    by_arm: dict[tuple, dict[str, dict]] = {}
    for row in rows:
        if "failed" not in row:
            by_arm.setdefault((row["start"], row["arm"], row["weights"]), {})[row["subject"]] = row
    found = []
    for (start, arm, which), own in by_arm.items():
        others = {START: by_arm.get((start, START, None), {})} if arm != START else {}
        if rivals.get(arm, arm) != arm:
            others[rivals[arm]] = next(
                (those for (_, name, weights), those in by_arm.items() if (name, weights) == (rivals[arm], which)), {}
            )
        about = {"start": start, "first": arm, "weights": which}
        found += [about | {"second": name} | gap for name, those in others.items() if (gap := _gap(own, those))]
    return found


def _gap(own: dict[str, dict], other: dict[str, dict]) -> dict:
    gaps = paired_gaps(own, other, COMPARED)
    return {"n_subjects": len(own.keys() & other.keys())} | gaps if gaps else {}


def decided(gaps: list[dict], failed: set[tuple]) -> dict[str, dict[str, dict[str, bool]]]:
    """For every reading and kind of weights: ``helps`` if it is nearer than its start, ``beats`` if than its rival.

    Nearer: the interval of the difference in ASSD lies below zero, and the flow did not fail on any subject. ``failed``
    contains the readings and the kinds of weights whose flow failed on one.
    """
    found: dict[str, dict[str, dict[str, bool]]] = {}
    for gap in gaps:
        name = "helps" if gap["second"] == START else "beats"
        own = found.setdefault(gap["first"], {which: {} for which in WHICH})
        own[gap["weights"]][name] = (gap["first"], gap["weights"]) not in failed and gap["assd_mm"]["high"] < 0
    return found
