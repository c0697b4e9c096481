"""The ledger of claims: a person writes the words, and the committed results say whether they still hold.

``book/claims.yaml`` has the words, with ``{numbers}``, and the status that they were written for. A rule computes the
status and the numbers. Where the two statuses differ, there is no page until somebody has written the words anew.
"""

import dataclasses
import string
from collections.abc import Callable, Iterable
from pathlib import Path

import yaml

from meshot.errors import require_choice
from meshot.provenance import read_results
from meshot_book.notebook import markdown_table

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
ASSUMING = "reproduced under a further assumption"
CHOICE = "depends on a choice left open"
NOT_REPRODUCED = "not reproduced"
#: Trained with less computation than in the paper: a larger network or a longer training may change the result.
AT_THIS_BUDGET = "not reproduced at this budget"
NOT_TESTABLE = "not testable here"
NOT_TESTED = "not yet tested"
#: A proof decides the claim, so that no measurement can give it another status.
PROVED = "decided by a proof"
STATUSES = (REPRODUCED, IN_PART, ASSUMING, CHOICE, NOT_REPRODUCED, AT_THIS_BUDGET, PROVED, NOT_TESTABLE, NOT_TESTED)


@dataclasses.dataclass(frozen=True, eq=False)
class Verdict:
    """What the results of an experiment say about a claim.

    Parameters
    ----------
    status : str
        One of the nine statuses, which are the upper-case names of :mod:`meshot_book.claims`.
    numbers : dict
        The numbers in the words of the claim, by name.
    tables : tuple of lists
        The rows of each table behind the verdict.
    fits : bool
        Whether all that the words say without a number is true, and, for a theorem, whether the measurements agree with
        it.

    Raises
    ------
    ValueError
        If the status is not one of the nine.
    """

    status: str
    numbers: dict[str, object]
    tables: tuple[list[dict], ...] = ()
    fits: bool = True

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

    def __post_init__(self):
        written, found = self.claim["status"], self.verdict.status
        if (found == PROVED) != ("proof" in self.claim):
            raise ValueError(
                f"claim {self.claim['id']} ({self.claim['claim']}): its status is {found!r}, but it names "
                f"{'no' if found == PROVED else 'a'} proof. A claim names a proof if and only if it is a theorem: "
                "correct it in claims.yaml"
            )
        if written == found and self.verdict.fits:
            return
        why = f"now say {found!r}" if written != found else "deny a fact that the words state"
        raise ValueError(
            f"claim {self.claim['id']} ({self.claim['claim']}): its words were written for {written!r}, but the "
            f"results {why}. Read the results, and write its status and its words in claims.yaml anew"
        )

    def words(self, part: str) -> str:
        """The number, meaning, says, found or rule of the claim, with its numbers."""
        numbers = self.verdict.numbers
        phrases = self.claim.get("phrases", {}).items()
        return fill(
            self.claim[part], numbers | {key: [fill(each, row) for row in numbers[key]] for key, each in phrases}
        )


def read_entries(claims: Path, experiments: Path, rules: dict[int, Rule]) -> list[Entry]:
    """Read all claims and compute their verdicts.

    Parameters
    ----------
    claims : path
        The YAML list of claims; its head says what each has.
    experiments : path
        The folder of experiments, each with its ``results.json``.
    rules : dict
        For every tested claim the function from the experiment's record, and those of the further experiments in their
        order, to a :class:`Verdict`.

    Raises
    ------
    ValueError
        If the results of a claim's experiment are missing, if a rule is missing, or if the words of a claim do not fit
        the results.
    """
    return [_entry(row, experiments, rules) for row in yaml.safe_load(claims.read_text(encoding="utf-8"))]


def _entry(row: dict, experiments: Path, rules: dict[int, Rule]) -> Entry:
    verdict, records = Verdict(NOT_TESTED, {}), ()
    if "experiment" in row:
        if row["id"] not in rules:
            raise ValueError(
                f"claim {row['id']} names the experiment {row['experiment']!r}, but there is no rule for it: add one"
            )
        names = [row["experiment"], *row.get("also", [])]
        records = tuple(read_results(experiments / name / "results.json") for name in names)
        verdict = rules[row["id"]](*records)
    return Entry(row, verdict, records)


def _spread(found: dict) -> str:
    """A mean, with its standard deviation if there is one."""
    if found["mean"] is None:
        return "–"
    return f"{found['mean']:.3g}" + ("" if found["sd"] is None else f" ± {found['sd']:.2g}")


def _interval(found: dict) -> str:
    """A difference, with its interval if there is one."""
    return f"{found['gap']:+.3g}" + ("" if found["low"] is None else f" [{found['low']:+.3g}, {found['high']:+.3g}]")


def _percent(share: float) -> str:
    """A share in per cent, and as a multiple from tenfold on."""
    if abs(share) >= 10:
        return f"{share:.3g} times"
    return f"{100 * share:.3g} %" if abs(share) > 1e-9 else "0 %"  # within roundoff


_FORMS = {
    "words": lambda name: name.replace("_", " "),
    "yes": lambda value: "yes" if value else "no",
    "percent": _percent,
    "interval": _interval,
    "spread": _spread,
}
_JOINTS = {",": ", ", ";": "; ", "|": " | ", "and": " and ", "to": " to "}


class _Forms(string.Formatter):
    def format_field(self, value: object, spec: str) -> str:
        if value is None:
            return "–"
        if isinstance(value, list):
            joint, _, rest = spec.partition(" ")
            joint, spec = (joint, rest) if joint in _JOINTS else (",", spec)
            shown = ends(value) if joint == "to" else value
            return _JOINTS[joint].join(self.format_field(each, spec) for each in shown) or "none"
        if spec in _FORMS:
            return _FORMS[spec](value)
        if spec.startswith("−"):
            return format(value, spec[1:]).replace("-", "−")
        return format(value, spec)


def fill(template: str, values: dict) -> str:
    """The template with the values, as by ``str.format``, and with more formats."""
    # A list is written with commas, or with what stands before the format of its items: ``;``, ``|``, ``and``; ``to``
    # gives its two ends. A ``−`` before the format of a number is the minus sign of the text. ``words`` writes a name
    # with spaces, ``interval`` a difference, ``spread`` mean ± standard deviation, ``percent`` a share, ``yes`` a truth
    # value. What is missing is a dash.
    return _Forms().vformat(template, (), values)


def table(rows: list[dict], columns: dict[str, str]) -> str:
    """Rows as a Markdown table: a template for each head, and one for the cells below it.

    If a head depends on the row, rows that agree in the other columns share a line.
    """
    heads = [head for each in columns for head in dict.fromkeys(fill(each, row) for row in rows)]
    lines: dict[object, dict] = {}
    for number, row in enumerate(rows):
        fixed = tuple(fill(cell, row) for head, cell in columns.items() if "{" not in head)
        key = number if len(fixed) == len(columns) else fixed
        lines.setdefault(key, dict.fromkeys(heads, "–")).update(
            (fill(h, row), fill(c, row)) for h, c in columns.items()
        )
    return markdown_table(list(lines.values()))


def where(rows: list[dict], **wanted: object) -> list[dict]:
    """The rows that have these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def ends(values: Iterable[float]) -> list[float]:
    """The smallest and the largest value."""
    found = sorted(values)
    return [found[0], found[-1]]


_HEAD = """# Claims ledger

This page has a verdict on each claim of the paper {cite:p}`le2024ddot`, and on questions of our own that the paper
leaves open. Every number and status is computed from the result files in `experiments/`. The sentences are written by
people, and a test fails where the results no longer support one. A claim that is *decided by a proof* is true or false
by that proof. Its measurements illustrate the proof, and no measurement could give it another status. The data sets of
the paper are under data-use agreements. Its tables are therefore rebuilt on other data, which the details of each claim
name.
"""
_PAPER = """## What the paper claims
"""
_OURS = """## Questions of ours

The paper does not make these claims. They follow from what it uses, or from what it leaves open. Row 25
is about a loss of this book.
"""


def ledger_page(claims: Path, experiments: Path, rules: dict[int, Rule]) -> str:
    """The page in MyST Markdown: a card for each claim, with folded details.

    Parameters and errors as for :func:`meshot_book.claims.read_entries`.
    """
    entries = read_entries(claims, experiments, rules)
    counts = {status: sum(entry.verdict.status == status for entry in entries) for status in STATUSES}
    labels = [f"- [{n}]{{.ledger-count .{_kind(status)}}} {status}" for status, n in counts.items() if n]
    parts = [_HEAD, "\n".join(["::::{div} ledger-counts", *labels, "::::", ""]), _PAPER]
    parts += [_card(entry) for entry in entries if not entry.claim.get("ours")]
    parts += [_OURS, *(_card(entry) for entry in entries if entry.claim.get("ours"))]
    return "\n".join(parts)


def _kind(status: str) -> str:
    """The CSS class of a status."""
    return "status-" + status.replace(" ", "-")


def _card(entry: Entry) -> str:
    claim, status = entry.claim, entry.verdict.status
    lines = [
        f"(claim-{claim['id']})=",
        f"::::::{{div}} claim {_kind(status)}",
        f":::::{{div}} claim-headline\n[{entry.words('number')}]{{.claim-number}}\n{entry.words('meaning')}\n:::::",
        f":::::{{div}} claim-words\n**{claim['id']}. {claim['claim']}**\n",
        f"[{status.capitalize()}.]{{.claim-status}} {entry.words('says')}\n",
    ]
    lines += [_details(entry)] if entry.records else []
    return "\n".join([*lines, ":::::", "::::::", ""])


def _details(entry: Entry) -> str:
    claim = entry.claim

    def of_each(written: Callable[[dict], str]) -> str:
        return "; ".join(dict.fromkeys(map(written, entry.records)))

    found = {
        "The paper": f"{claim['paper']} ({claim['where']})",
        "Ours": entry.words("found"),
        "Proof": claim.get("proof"),
        "Rule": entry.words("rule"),
        "Chapter": f"[](<project:{claim['chapter']}.ipynb>)",
        "Data": claim.get("data") or of_each(lambda record: record["data"]),
        "Command": of_each(lambda each: f"`{each['command']}` ({each['seconds']:.0f} s on {each['machine']})"),
        "Commit": of_each(lambda record: f"`{record['commit']}`, {record['date']}"),
    }
    lines = ["::::{dropdown} Numbers, rule and provenance"]
    lines += [f"{name}\n: {text}\n" for name, text in found.items() if text]
    tables = [table(rows, columns) for rows, columns in zip(entry.verdict.tables, claim["tables"], strict=True)]
    return "\n".join([*lines, "\n\n".join(tables), "::::"])
