"""The ledger of claims: a row per claim of the paper, its status computed from committed results, never typed."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import yaml

from meshot.provenance import read_results

REPRODUCED = "reproduced"
CONDITION = "reproduced with a condition"
NOT_REPRODUCED = "not reproduced"
NOT_TESTABLE = "not testable here"
NOT_TESTED = "not yet tested"
STATUSES = (REPRODUCED, CONDITION, NOT_REPRODUCED, NOT_TESTABLE, NOT_TESTED)


@dataclasses.dataclass(frozen=True, eq=False)
class Verdict:
    """What an experiment says of a claim.

    Parameters
    ----------
    status : str
        One of the five statuses: those at this door that are written in capitals.
    ours : str
        Our number or numbers, with unit.
    tolerance : str
        The rule by which the status follows from the numbers.
    numbers : str
        A Markdown table of the numbers behind the verdict; may be empty.

    Raises
    ------
    ValueError
        If the status is not one of the five.
    """

    status: str
    ours: str
    tolerance: str
    numbers: str = ""

    def __post_init__(self):
        if self.status not in STATUSES:
            raise ValueError(f"status is {self.status!r}; one of {', '.join(STATUSES)} is needed")


Rule = Callable[[dict], Verdict]


def ledger_page(claims: Path, experiments: Path, rules: dict[int, Rule]) -> str:
    """The page, in MyST Markdown.

    Parameters
    ----------
    claims : path
        The YAML list of claims: id, claim, where, paper, and for those tested the experiment and the chapter.
    experiments : path
        The folder of experiments, each with its ``results.json``.
    rules : dict
        For every tested claim the function from the experiment's record to a :class:`Verdict`.

    Raises
    ------
    ValueError
        If a claim names an experiment without results, or a rule is missing.
    """
    rows = yaml.safe_load(claims.read_text(encoding="utf-8"))
    verdicts = [(row, *_verdict_on(row, experiments, rules)) for row in rows]
    parts = [_HEAD, _counts([verdict for _, verdict, _ in verdicts]), _table(verdicts)]
    parts += [_details(row, verdict, record) for row, verdict, record in verdicts if record is not None]
    return "\n".join(parts)


_HEAD = """---
html_theme.sidebar_secondary.remove: true
---

# Claims ledger

One row for each claim of the paper {cite:p}`le2024ddot`: what it says, what we found, and by which rule the status
follows from the numbers. Nothing on this page is written by hand: it is generated from the result files in
`experiments/`, each with its command, commit, seeds and versions, and a test compares the page with them. The data sets
of the paper are under data-use agreements and are not here, so that every table is rebuilt on other data, named in the
row.
"""


def _verdict_on(row: dict, experiments: Path, rules: dict[int, Rule]) -> tuple[Verdict, dict | None]:
    if "experiment" not in row:
        return Verdict(NOT_TESTED, "–", "–"), None
    if row["id"] not in rules:
        raise ValueError(
            f"claim {row['id']} names the experiment {row['experiment']!r}, but there is no rule for it: add one"
        )
    record = read_results(experiments / row["experiment"] / "results.json")
    return rules[row["id"]](record), record


def _counts(verdicts: list[Verdict]) -> str:
    counts = {status: sum(verdict.status == status for verdict in verdicts) for status in STATUSES}
    return "So far: " + ", ".join(f"{count} {status}" for status, count in counts.items() if count) + ".\n"


def _table(verdicts: list[tuple[dict, Verdict, dict | None]]) -> str:
    lines = [
        ":::{div} ledger",
        "| | claim | status | the paper's number | ours | where | data |",
        "|---|---|---|---|---|---|---|",
    ]
    for row, verdict, record in verdicts:
        link = f"[{verdict.status}](#claim-{row['id']})" if record else verdict.status
        data = record["data"] if record else "–"
        cells = [str(row["id"]), row["claim"], link, row["paper"], verdict.ours, row["where"], data]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join([*lines, ":::", ""])


def _details(row: dict, verdict: Verdict, record: dict) -> str:
    lines = [
        f"(claim-{row['id']})=",
        f"## Claim {row['id']}: {row['claim']}",
        "",
        f"**{verdict.status.capitalize()}.** {verdict.ours}",
        "",
        f"Rule\n: {verdict.tolerance}",
        "",
        f"Command\n: `{record['command']}` ({record['seconds']:.0f} s on {record['machine']})",
        "",
        f"Commit\n: `{record['commit']}`, {record['date']}",
        "",
        f"Data\n: {record['data']}",
        "",
        f"Chapter\n: [](<project:{row['chapter']}.ipynb>)",
        "",
        ":::{div} numbers",
        verdict.numbers,
        ":::",
        "",
    ]
    return "\n".join(lines)
