"""The ledger as a page: a card for each claim, with folded details."""

from collections.abc import Callable
from pathlib import Path

from meshot_book.claims.ledger import STATUSES, Entry, Rule, read_entries

_HEAD = """# Claims ledger

This page has a verdict on each claim of the paper {cite:p}`le2024ddot`, and on questions of our own that the paper
leaves open. Every sentence and number is computed from the result files in `experiments/`, and a test compares them.
The data sets of the paper are under data-use agreements. Its tables are therefore rebuilt on other data, which the
details of each claim name.
"""
_PAPER = """## What the paper claims
"""
_OURS = """## Questions of ours

The paper does not make these claims. They follow from what it uses, or from what it leaves open. Row 25
is about a loss of this book.
"""


def ledger_page(claims: Path, experiments: Path, rules: dict[int, Rule]) -> str:
    """The page in MyST Markdown. Parameters and errors as for :func:`meshot_book.claims.read_entries`."""
    entries = read_entries(claims, experiments, rules)
    parts = [_HEAD, _counts(entries), _PAPER]
    parts += [_card(entry) for entry in entries if not entry.claim.get("ours")]
    parts += [_OURS, *(_card(entry) for entry in entries if entry.claim.get("ours"))]
    return "\n".join(parts)


def _counts(entries: list[Entry]) -> str:
    """The number of claims with each status, as a row of labels."""
    lines = ["::::{div} ledger-counts"]
    for status in STATUSES:
        count = sum(entry.verdict.status == status for entry in entries)
        if count:
            lines.append(f"- [{count}]{{.ledger-count .{_kind(status)}}} {status}")
    return "\n".join([*lines, "::::", ""])


def _kind(status: str) -> str:
    """The CSS class of a status."""
    return "status-" + status.replace(" ", "-")


def _card(entry: Entry) -> str:
    claim, verdict = entry.claim, entry.verdict
    number, meaning = verdict.headline
    lines = [
        f"(claim-{claim['id']})=",
        f"::::::{{div}} claim {_kind(verdict.status)}",
        f":::::{{div}} claim-headline\n[{number}]{{.claim-number}}\n{meaning}\n:::::",
        f":::::{{div}} claim-words\n**{claim['id']}. {claim['claim']}**\n",
        f"[{verdict.status.capitalize()}.]{{.claim-status}} {verdict.says}\n",
    ]
    lines += [_details(entry)] if entry.records else []
    return "\n".join([*lines, ":::::", "::::::", ""])


def _details(entry: Entry) -> str:
    claim, verdict = entry.claim, entry.verdict

    def of_each(written: Callable[[dict], str]) -> str:
        return "; ".join(dict.fromkeys(map(written, entry.records)))

    found = {
        "The paper": f"{claim['paper']} ({claim['where']})",
        "Ours": verdict.ours,
        "Rule": verdict.tolerance,
        "Chapter": f"[](<project:{claim['chapter']}.ipynb>)",
        "Data": claim.get("data") or of_each(lambda record: record["data"]),
        "Command": of_each(lambda each: f"`{each['command']}` ({each['seconds']:.0f} s on {each['machine']})"),
        "Commit": of_each(lambda record: f"`{record['commit']}`, {record['date']}"),
    }
    lines = ["::::{dropdown} Numbers, rule and provenance"]
    lines += [f"{name}\n: {text}\n" for name, text in found.items()]
    return "\n".join([*lines, verdict.numbers, "::::"])
