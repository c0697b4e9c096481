"""Claim 17: DDOT with another loss or encoding, each with its own learning rate, and in other readings of the paper.

The protocols ``controls.yaml``, ``readings.yaml``, ``candidates.yaml`` and ``budget.yaml`` in ``experiments/ddot`` say
what the status needs. "Nearer" means that the 95 % interval of the paired difference in ASSD (Student) lies below zero.
All results are those of the last weights, on held-out subjects. An exchange is compared with DDOT with the same rates.
The kernel norm is no exchange of the paper. It is trained by another protocol with the same data and steps.
"""

from meshot_book.claims.ledger import AT_THIS_BUDGET, IN_PART, Verdict
from meshot_book.claims.rules.comparison import interval, named
from meshot_book.measurements import MAIN, paired_gaps
from meshot_book.notebook import digits, markdown_table

OURS, KERNEL, START = "ddot_20mm", "kernel_norm", "start"
SHOWN = {
    "emd_mm": "EMD (mm)", "swd_mm": "SWD (mm)", "assd_mm": "ASSD (mm)", "normals": "normals",
    "crossing_percent": "crossing (%)",
}  # fmt: skip
DIFFERENCES = {f"{name}_mm": f"minus DDOT, {name.upper()} [95 %]" for name in ("emd", "swd", "assd")}


def exchanges_verdict(controls: dict, readings: dict, candidates: dict, budget: dict) -> Verdict:
    """Claim 17 from its protocols: exchanges of DDOT, readings, the kernel norm, and longer and wider trainings.

    There is one seed on one column, so that the claim is at best reproduced in part.
    """
    exchanged = [arm for arm, each in controls["config"]["readings"].items() if "changes" in each]
    nearer = [arm for arm in exchanged if _decided(controls, arm, "beats")]
    in_swd = [_rival_gap(controls, arm, "swd_mm") for arm in exchanged]
    smaller = sum(gap["high"] < 0 for gap in in_swd if gap)
    own = [arm for arm, each in readings["config"]["readings"].items() if each["system"] == "ddot"]
    helps, beats = ([arm for arm in own if _decided(readings, arm, name)] for name in ("helps", "beats"))
    supported = set(helps) & set(beats)
    shorter = [arm for arm in own if (gap := gap_of(readings, arm, START, "swd_mm")) and gap["high"] < 0]
    return Verdict(
        status=IN_PART if supported and not nearer else AT_THIS_BUDGET,
        says=(
            f"At a small budget, {len(nearer)} of {len(exchanged)} exchanges end nearer to the truth than DDOT in "
            f"ASSD, and {smaller} in SWD. DDOT ends nearer than it begins in {len(helps)} of {len(own)} readings of "
            f"the paper in ASSD, and in {len(shorter)} in SWD."
        ),
        headline=(f"{len(supported)} of {len(own)}", "readings in which DDOT helps and is nearer than Chamfer"),
        ours=f"{_sentence(controls, readings, nearer)}. {_budgets(budget)}",
        tolerance=(
            "in part (one seed on one column) if in one reading of the paper at least DDOT is nearer to the truth than "
            "the initial surface and than the same network trained with Chamfer, and no exchange of its loss or "
            "encoding is nearer than DDOT. Nearer: the 95 % interval of the difference in ASSD over subjects "
            "(Student) lies below zero. Not reproduced at this budget otherwise"
        ),
        numbers="\n\n".join(
            [_exchanges_table(controls, candidates), _readings_table(readings), _readings_table(budget)]
        ),
    )


def _decided(record: dict, arm: str, name: str) -> bool:
    return record["results"]["decided"].get(arm, {"last": {}})["last"].get(name, False)


def _rival_gap(record: dict, arm: str, metric: str = "assd_mm") -> dict | None:
    """An arm minus its rival: with the last weights, over held-out subjects."""
    return gap_of(record, arm, record["config"]["readings"][arm].get("rival", record["config"]["rival"]), metric)


def _sentence(controls: dict, readings: dict, nearer: list[str]) -> str:
    column = named((controls["config"]["cohort"], controls["config"]["side"]))
    first = written(gap_of(controls, OURS, START))
    ends = "; ".join(f"{title_of(controls, arm)} {_mean(controls, arm, 'assd_mm')}" for arm in arms_of(controls))
    listed = ", ".join(title_of(controls, arm) for arm in nearer) or "none"
    rivals = {arm: controls["config"]["readings"][arm].get("rival") for arm in arms_of(controls)}
    others = [f"{title_of(controls, arm)} with {title_of(controls, rival)}" for arm, rival in rivals.items() if rival]
    return (
        f"{column}. ASSD in mm: initially {_mean(controls, START, 'assd_mm')}; {ends}. Nearer than DDOT: {listed}. "
        f"DDOT minus the initial surface: {first} mm. The readings have {_steps(readings)} steps. "
        f"Compared with another rival than DDOT: {'; '.join(others) or 'none'}"
    )


def _budgets(budget: dict) -> str:
    ends = [
        f"{title_of(budget, arm)} {_mean(budget, arm, 'assd_mm')} after {n_steps_of(budget, arm)} steps"
        for arm in arms_of(budget)
    ]
    return f"Longer and wider trainings: {'; '.join(ends)}"


def n_steps_of(record: dict, arm: str) -> int:
    """The number of steps that an arm was trained for."""
    return next(each["n_steps"] for each in record["results"]["trainings"] if each["arm"] == arm)


def _exchanges_table(controls: dict, candidates: dict) -> str:
    rows = [_row(controls, arm) for arm in (START, *arms_of(controls))]
    if KERNEL in arms_of(candidates):
        gaps = paired_gaps(_held_out(candidates, KERNEL), _held_out(controls, OURS), DIFFERENCES)
        rows.append(_row(candidates, KERNEL) | {name: written(gaps.get(key)) for key, name in DIFFERENCES.items()})
    return markdown_table(rows)


def _held_out(record: dict, arm: str) -> dict[str, dict]:
    """The rows of an arm with the last weights, by held-out subject."""
    wanted = (arm, "last", "test", MAIN)
    rows = [row for row in record["results"]["subjects"] if "failed" not in row]
    found = [row for row in rows if tuple(row[key] for key in ("arm", "weights", "split", "kind")) == wanted]
    return {row["subject"]: row for row in found}


def _row(record: dict, arm: str) -> dict[str, str]:
    cells = {"loss, encoding": title_of(record, arm)}
    cells |= {name: _mean(record, arm, key) for key, name in SHOWN.items()}
    return cells | {name: written(_minus_ours(record, arm, metric)) for metric, name in DIFFERENCES.items()}


def _minus_ours(record: dict, arm: str, metric: str) -> dict | None:
    """An arm minus DDOT with the same rates."""
    if arm != START:
        return _rival_gap(record, arm, metric)
    gap = gap_of(record, OURS, START, metric)
    return gap and {"gap": -gap["gap"], "low": -gap["high"], "high": -gap["low"]}


def _readings_table(readings: dict) -> str:
    rows = []
    for arm, each in readings["config"]["readings"].items():
        if arm not in arms_of(readings):
            continue
        rival = each.get("rival", readings["config"]["rival"]) if each["system"] == "ddot" else arm
        gaps = [gap_of(readings, arm, second) for second in (START, rival)]
        rows.append({"reading": title_of(readings, arm), "steps": str(n_steps_of(readings, arm))})
        rows[-1] |= {"ASSD (mm)": _mean(readings, arm, "assd_mm")}
        rows[-1] |= dict(zip(("minus initial [95 %]", "minus CortexODE [95 %]"), map(written, gaps), strict=True))
    return markdown_table(rows)


def arms_of(record: dict) -> list[str]:
    """The trained arms, in the order of the protocol."""
    trained = {each["arm"] for each in record["results"]["trainings"]}
    return [arm for arm in record["config"]["readings"] if arm in trained]


def title_of(record: dict, arm: str) -> str:
    """The title of an arm in the protocol."""
    return "initial surface" if arm == START else record["config"]["readings"][arm]["title"]


def _mean(record: dict, arm: str, key: str) -> str:
    start = "initial" if arm == START else record["config"]["readings"][arm].get("start", "initial")
    wanted = (arm, None if arm == START else "last", start, "test", "template")
    names = ("arm", "weights", "start", "split", "kind")
    (row,) = [each for each in record["results"]["means"] if tuple(each[name] for name in names) == wanted]
    return digits(row[key]["mean"], 3)


def gap_of(record: dict, first: str, second: str, metric: str = "assd_mm") -> dict | None:
    """The first minus the second with the last weights, paired over held-out subjects. None if it was not computed."""
    for each in record["results"]["differences"]:
        if (each["first"], each["second"], each["weights"]) == (first, second, "last"):
            return each[metric]
    return None


def written(gap: dict | None) -> str:
    """A difference with its interval, or a dash."""
    return "–" if gap is None else interval(gap)


def _steps(record: dict) -> str:
    return "–".join(str(n) for n in sorted({each["n_steps"] for each in record["results"]["trainings"]}))
