"""Claim 26: whether surfaces with a smaller sliced loss are nearer to the truth, for all trainings with DDOT's loss.

The loss of a network is that of its training, between the surface and the truth, before and after its flow. All results
are those of the last weights, on held-out subjects.
"""

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, NOT_TESTED, REPRODUCED, Verdict
from meshot_book.claims.rules.trial import START, arms_of, gap_of, n_steps_of, title_of, written
from meshot_book.measurements import MAIN
from meshot_book.notebook import digits, markdown_table


def own_loss_verdict(readings: dict, budget: dict, alone: dict) -> Verdict:
    """Claim 26 from the readings of the paper, the longer and wider trainings, and those on one subject alone.

    The last ones have no held-out subjects, and are stated only.
    """
    found = [row for record in (readings, budget) for row in _rows(record)]
    falls = [row for row in found if row["quotient"] < 1]
    farther, nearer = (
        [row for row in falls if row["gap"] and beyond(row["gap"])]
        for beyond in (lambda gap: gap["low"] > 0, lambda gap: gap["high"] < 0)
    )
    if not falls:
        status = NOT_TESTED
    elif farther:
        status = NOT_REPRODUCED
    else:
        status = REPRODUCED if len(nearer) == len(falls) else IN_PART
    return Verdict(
        status=status,
        says=(
            f"The loss of DDOT falls on new subjects in {len(falls)} of {len(found)} trainings. In {len(farther)} of "
            f"these the surfaces end farther from the truth in ASSD than they begin, and in {len(nearer)} nearer."
        ),
        headline=(f"{len(farther)} of {len(falls)}", "trainings in which the loss falls and the distance grows"),
        ours=f"{'; '.join(map(_ended, found))}. {_on_one_subject(alone)}",
        tolerance=(
            "reproduced if the surfaces end nearer to the truth than they begin in every training whose loss falls; "
            "not reproduced if they end farther in one of them; in part otherwise. Nearer, farther: the 95 % interval "
            "of the difference in ASSD over held-out subjects (Student) excludes zero"
        ),
        numbers=markdown_table(
            [
                {
                    "training": row["title"],
                    "steps": str(row["steps"]),
                    "loss, after / before": digits(row["quotient"], 2),
                    "ASSD minus initial (mm) [95 %]": written(row["gap"]),
                }
                for row in found
            ]
        ),
    )


def _ended(row: dict) -> str:
    quotient, gap = digits(row["quotient"], 2), written(row["gap"])
    return f"{row['title']}, {row['steps']} steps: loss × {quotient}, ASSD {gap} mm"


def _on_one_subject(record: dict) -> str:
    """How many trainings with DDOT's loss on one subject end nearer to its truth than they begin."""
    surfaces = {row["arm"]: row for row in record["results"]["surfaces"]}
    arms = [surfaces[arm] for arm, each in record["config"]["arms"].items() if each["system"] == "ddot"]
    nearer = [row for row in arms if row["assd_mm"] < surfaces["initial"]["assd_mm"]]
    left = sorted(row["sliced_20"] / surfaces["initial"]["sliced_20"] for row in arms)
    return (
        f"On one training subject alone (chapter 35), {len(nearer)} of {len(arms)} trainings end nearer than they "
        f"begin, with loss × {digits(left[0], 2)} to {digits(left[-1], 2)}"
    )


def _rows(record: dict) -> list[dict]:
    """For every training with DDOT's loss: the quotient of its loss, and the difference in ASSD."""
    config = record["config"]["readings"]
    return [
        {
            "title": title_of(record, arm),
            "steps": n_steps_of(record, arm),
            "quotient": _quotient(record, arm),
            "gap": gap_of(record, arm, START),
        }
        for arm in arms_of(record)
        if config[arm]["system"] == "ddot"
    ]


def _quotient(record: dict, arm: str) -> float:
    """The mean loss after the flow, divided by that before it."""
    wanted = (arm, "last", "test", MAIN)
    keys = ("arm", "weights", "split", "kind")
    (row,) = [each for each in record["results"]["means"] if tuple(each[key] for key in keys) == wanted]
    return row["loss_after"]["mean"] / row["loss_before"]["mean"]
