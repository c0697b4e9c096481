"""The ledger of claims. Each verdict is computed from committed results by a rule, never typed."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import yaml

from meshot.errors import require_choice
from meshot.provenance import read_results

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
ASSUMING = "reproduced under a further assumption"
CHOICE = "depends on a choice left open"
NOT_REPRODUCED = "not reproduced"
#: Trained with less computation than in the paper: a larger network or a longer training may change the result.
AT_THIS_BUDGET = "not reproduced at this budget"
NOT_TESTABLE = "not testable here"
NOT_TESTED = "not yet tested"
STATUSES = (REPRODUCED, IN_PART, ASSUMING, CHOICE, NOT_REPRODUCED, AT_THIS_BUDGET, NOT_TESTABLE, NOT_TESTED)


@dataclasses.dataclass(frozen=True, eq=False)
class Verdict:
    """The verdict of an experiment on a claim.

    Parameters
    ----------
    status : str
        One of the eight statuses, which are the upper-case names of :mod:`meshot_book.claims`.
    says : str
        The verdict in one sentence, with its condition.
    headline : tuple of str
        The most important number, and what it counts or measures.
    ours : str
        Our numbers, with units.
    tolerance : str
        The rule that determines the status from the numbers.
    numbers : str
        A Markdown table of the numbers behind the verdict; may be empty.

    Raises
    ------
    ValueError
        If the status is not one of the eight.
    """

    status: str
    says: str
    headline: tuple[str, str]
    ours: str
    tolerance: str
    numbers: str = ""

    def __post_init__(self):
        require_choice(self.status, "status", STATUSES)


#: A function from the record of a claim's experiment, and of the experiments under ``also``, to a verdict.
Rule = Callable[..., Verdict]


@dataclasses.dataclass(frozen=True, eq=False)
class Entry:
    """A claim, its verdict, and the records of the experiments that its rule reads; none if it is not tested."""

    claim: dict
    verdict: Verdict
    records: tuple[dict, ...]


def read_entries(claims: Path, experiments: Path, rules: dict[int, Rule]) -> list[Entry]:
    """Read all claims and compute their verdicts.

    Parameters
    ----------
    claims : path
        The YAML list of claims: id, claim, where, paper; ``ours`` for claims that the paper does not make; experiment
        and chapter for claims that are tested; ``also`` lists further experiments that the rule reads, and ``data``
        says what the claim is tested on if it is a part of what the experiment measures.
    experiments : path
        The folder of experiments, each with its ``results.json``.
    rules : dict
        For every tested claim the function from the experiment's record, and those of the further experiments in their
        order, to a :class:`Verdict`.

    Raises
    ------
    ValueError
        If the results of a claim's experiment are missing, or a rule is missing.
    """
    return [_entry(row, experiments, rules) for row in yaml.safe_load(claims.read_text(encoding="utf-8"))]


def _entry(row: dict, experiments: Path, rules: dict[int, Rule]) -> Entry:
    if "experiment" not in row:
        waiting = Verdict(NOT_TESTED, "No experiment has tested this yet.", ("–", "no result"), "–", "–")
        return Entry(row, waiting, ())
    if row["id"] not in rules:
        raise ValueError(
            f"claim {row['id']} names the experiment {row['experiment']!r}, but there is no rule for it: add one"
        )
    names = [row["experiment"], *row.get("also", [])]
    records = tuple(read_results(experiments / name / "results.json") for name in names)
    return Entry(row, rules[row["id"]](*records), records)
