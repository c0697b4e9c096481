"""The reproduction report as a PDF, typeset from the committed results: ``python book/report.py`` (``make report``).

``book/report/report.typ`` has the words, with ``#v("name")`` in place of each number, and ``book/report/values.yaml``
says where each named number comes from. Numbers that are typed in the words, and names that are unknown or unused, are
refused.
"""

import base64
import datetime
import json
import re
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import typst
import yaml

from meshot.files import whole_file
from meshot.provenance import read_results
from meshot_book.claims import Entry, fill, read_entries
from meshot_book.claims.rules import RULES

ROOT = Path(__file__).resolve().parent.parent
TEXT, VALUES = ROOT / "book" / "report" / "report.typ", ROOT / "book" / "report" / "values.yaml"
PDF = ROOT / "build" / "report.pdf"
#: The fields of an entry of ``values.yaml``.
FIELDS = {"of", "claim", "stored", "row", "column", "files", "at", "take", "over", "show", "printed", "place"}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
TAKEN = {
    "sum": sum, "count": len, "ends": lambda found: [min(found), max(found)],
    "mean": lambda found: sum(found) / len(found),
}  # fmt: skip
#: A step of a key: a name; ``[3]``; ``[a=b, c=d]``, the one row with these values; ``[* a=b]``, all such rows; ``[*]``.
STEP = re.compile(r"\.?(?P<name>[\w-]+)|\[(?P<choice>[^\]]*)\]")
#: What may stand in the words with digits in it, beside formulas, names such as MNI152, and citations.
ALLOWED = ("95 %",)
#: Formulas of the ledger, in LaTeX, as patterns and what Typst writes in their place.
MATH = (
    (r"\\lVert (.*?) \\rVert", r"norm(\1)"), (r"\\sqrt (\w)", r"sqrt(\1)"), (r"\\sqrt\{", "sqrt{"),
    (r"\\mathbb R", "RR"), (r"\\SW", 'upright("SW")'), (r"\\W", 'upright("W")'), (r"\\log", "log"), (r"\\le", "<="),
    (r"/", " slash "), ("{", "("), ("}", ")"),
)  # fmt: skip


# Looking up.


def look_up(record: object, key: str) -> object:
    """The value that a key leads to in a record of results."""
    found, at = [record], 0
    several = False
    while at < len(key):
        step = STEP.match(key, at)
        if not step:
            raise ValueError(f"the key {key!r} cannot be read from {key[at:]!r} on; write names, [3], [a=b] or [* a=b]")
        at = step.end()
        choice = step["choice"]
        if choice is not None and choice.startswith("*"):
            several = True
            found = [each for value in found for each in _chosen(_items(value, key), choice[1:])]
        else:
            found = [_one(value, step, key) for value in found]
    return found if several else found[0]


def _one(value: object, step: re.Match, key: str) -> object:
    choice = step["choice"]
    if choice is None or re.fullmatch(r"-?\d+", choice):
        index = step["name"] if choice is None else int(choice)
        try:
            return value[index]
        except (KeyError, IndexError, TypeError):
            has = ", ".join(map(str, value)) if isinstance(value, dict) else f"a {type(value).__name__}"
            raise ValueError(f"the key {key!r} has no {index!r}; there is {has[:200]}") from None
    rows = _chosen(_items(value, key), choice)
    if len(rows) != 1:
        raise ValueError(f"the key {key!r}: [{choice}] must choose one row, and chooses {len(rows)}")
    return rows[0]


def _items(value: object, key: str) -> list:
    if not isinstance(value, dict | list):
        raise ValueError(f"the key {key!r} chooses rows of a {type(value).__name__}; it needs a list or a dict")
    return list(value.values()) if isinstance(value, dict) else value


def _chosen(rows: list, conditions: str) -> list:
    """The rows whose values, as text, are equal (``=``) to the wanted ones, or begin with them (``^=``)."""
    for condition in filter(None, map(str.strip, conditions.split(","))):
        name, sign, wanted = re.fullmatch(r"(\w+)(\^?=)(.*)", condition).groups()
        kept = str.startswith if sign == "^=" else str.__eq__
        rows = [row for row in rows if kept(str(row.get(name)), wanted)]
    return rows


def stored_table(folder: Path, place: str) -> list[dict[str, str]]:
    """The rows of a table in the stored outputs of a chapter, by ``chapter/name``."""
    text = _stored(folder, place, "text/plain")
    heads, *rows = [re.split(r" {2,}", line.strip()) for line in text.splitlines()]
    return [dict(zip(heads, row, strict=True)) for row in rows]


def stored_figure(folder: Path, place: str) -> dict:
    """The picture of a figure in the stored outputs of a chapter, as bytes, and its description."""
    picture = base64.b64decode(_stored(folder, place, "image/png"))
    return {"png": list(picture), "alt": _cell(folder, place)["metadata"]["mystnb"]["image"]["alt"]}


def _cell(folder: Path, place: str) -> dict:
    chapter, name = place.split("/")
    path = folder / f"{chapter}.ipynb"
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"] if path.is_file() else []
    found = [c for c in cells if c["metadata"].get("mystnb", {}).get("figure", {}).get("name") == name]
    if not found:
        raise ValueError(f"{path} has no figure or table {name!r}; name one that a code cell of the chapter stores")
    return found[0]


def _stored(folder: Path, place: str, kind: str) -> str:
    for output in _cell(folder, place)["outputs"]:
        if kind in output.get("data", {}):
            return "".join(output["data"][kind])
    raise ValueError(f"{place} has no stored output of the kind {kind}; run the chapter: make notebooks")


# Values: the text of each number, with the file, the key and the commit that it comes from.


def expanded(stated: dict) -> dict[str, dict]:
    """The entries of ``values.yaml``; one with ``each: {x: [a, b]}`` becomes an entry for every ``<x>``."""
    found = {}
    for name, entry in stated.items():
        entry = dict(entry)
        ((word, choices),) = entry.pop("each", {"": [""]}).items()
        for choice in choices:
            own = {k: v.replace(f"<{word}>", choice) if isinstance(v, str) and word else v for k, v in entry.items()}
            found[name.replace(f"<{word}>", choice) if word else name] = own
            if unknown := own.keys() - FIELDS:
                raise ValueError(f"the value {name!r} has {', '.join(sorted(unknown))}; allowed: {sorted(FIELDS)}")
    return found


def value_of(name: str, entry: dict, root: Path, entries: dict[int, Entry]) -> dict[str, str]:
    """The text of one number, and its file, key and commit.

    Raises
    ------
    ValueError
        If the result, or the key within it, is missing.
    """
    show = entry.get("show", "{value}")
    try:
        if "printed" in entry:
            return _row(name, fill(show, {"value": entry["printed"]}), "the paper", entry["place"], "–")
        if "claim" in entry:
            own = entries[entry["claim"]]
            text = fill(show, own.verdict.numbers)
            return _row(name, text, *_source(own, f"row {entry['claim']}: {show}"))
        if "stored" in entry:
            (line,) = [
                line for line in stored_table(root / "notebooks", entry["stored"]) if entry["row"] in line.values()
            ]
            key = f"{entry['stored'].partition('/')[2]}, {entry['row']}, {entry['column']}"
            file = f"notebooks/{entry['stored'].partition('/')[0]}.ipynb"
            return _row(name, line[entry["column"]], file, key, "output")
        files = _files(root / "experiments", entry)
        records = [read_results(file) for file in files]
        found = [look_up(record, entry["at"]) for record in records]
        found = found[0] if "of" in entry else found
        if "take" in entry:
            found = TAKEN[entry["take"]](found)
        if "over" in entry:
            found = found / entry["over"]
        text = fill(show, {"value": found} | (found if isinstance(found, dict) else {}))
        where = f"experiments/{entry.get('files')}" if "files" in entry else str(files[0].relative_to(root))
        key = " ".join(filter(None, (entry.get("take"), entry["at"])))
        commits = ", ".join(dict.fromkeys(record["commit"] for record in records)) if "of" in entry else "of each file"
        return _row(name, text, where, key, commits)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ValueError(f"the value {name!r} of the report: {error}") from error


def _files(experiments: Path, entry: dict) -> list[Path]:
    if "files" in entry:
        return sorted(experiments.glob(entry["files"]))
    folder, _, file = entry["of"].partition(":")
    return [experiments / folder / (file or "results.json")]


def _source(entry: Entry, key: str) -> tuple[str, str, str]:
    names = [entry.claim["experiment"], *entry.claim.get("also", [])]
    commits = dict.fromkeys(record["commit"] for record in entry.records)
    return ", ".join(f"experiments/{name}/results.json" for name in names), key, ", ".join(commits)


def _row(name: str, text: str, file: str, key: str, commit: str) -> dict[str, str]:
    return {"name": name, "text": typographic(text), "file": file, "key": key, "commit": commit}


def typographic(text: str) -> str:
    """The text with minus signs, powers of ten, and thin spaces in long numbers, as a book has them."""
    text = re.sub(r"(?<=\d)_(?=\d{3})", "\N{NARROW NO-BREAK SPACE}", text)
    text = re.sub(r"\b(\d(?:\.\d+)?)e[+]?(-?)0*(\d+)\b", _power, text)
    return re.sub(r"(?<![\w^])-(?=\d)", "−", text)


def _power(found: re.Match) -> str:
    raised = f"10{(found[2] + found[3]).translate(RAISED)}"
    return raised if found[1] == "1" else f"{found[1]}·{raised}"


def claim_rows(entries: Iterable[Entry]) -> list[dict]:
    """The rows of the table of claims, in the markup of Typst."""
    rows = []
    for entry in entries:
        file, key, commit = _source(entry, f"row {entry.claim['id']}: headline")
        rows.append(
            {
                "id": str(entry.claim["id"]),
                "ours": entry.claim.get("ours", False),
                "claim": markup(typographic(entry.claim["claim"])),
                "status": entry.verdict.status,
                "number": markup(typographic(entry.words("number"))),
                "meaning": markup(entry.words("meaning")),
                "source": _row(f"claim {entry.claim['id']}", entry.words("number"), file, key, commit),
            }
        )
    return rows


def markup(text: str) -> str:
    """Words with formulas between dollars, as in the ledger, in the markup of Typst."""
    parts = text.split("$")
    for k, part in enumerate(parts):
        parts[k] = f"${_formula(part)}$" if k % 2 else re.sub(r"([\\#*_`<>@\[\]~])", r"\\\1", part)
    return "".join(parts)


def _formula(latex: str) -> str:
    for pattern, put in MATH:
        latex = re.sub(pattern, put, latex)
    if "\\" in latex:
        raise ValueError(f"the formula {latex!r} has a macro that Typst does not know; add it to MATH in report.py")
    return latex


# The document.


#: What names a place, such as a table of the paper or a row of the ledger.
PLACES = re.compile(r"\b(?:Tables?|Theorem|Findings?|chapters?|[Rr]ows?) \d+(?:(?:,| and| to) \d+)*")


def words_of(text: str) -> str:
    """The words of a text in Typst: without comments, code, references and formulas of single digits."""
    text = re.sub(r"//.*", "", text)
    text = re.sub(r'(?:v|figure-of)\("[^"]*"|#import .*|@[\w-]+|<[\w-]+>|\b\d+fr\b|\bwidth: \d+%', "", text)
    text = re.sub(r"\$[^$]*\$", lambda found: re.sub(r"(?<![\d.])\d(?![\d.])", "", found[0]), text)
    text = PLACES.sub("", text)
    for allowed in ALLOWED:
        text = text.replace(allowed, "")
    return text


def typed_numbers(text: str) -> list[str]:
    """The numbers that are typed in the words of a text in Typst, with digits or as words from seven on."""
    digits = re.findall(r"(?<![A-Za-z0-9])\d[\d.,]*", words_of(text))
    spelled = (
        r"\b(?:seven|eight|nine|ten|eleven|twelve|\w+teen|twenty|\w+ty-\w+|\w*hundreds?|\w*thousands?|millions?)\b"
    )
    return digits + re.findall(spelled, words_of(text), re.IGNORECASE)


def names_used(text: str) -> set[str]:
    """The names of the values that the words refer to."""
    return set(re.findall(r'#?\bv\("([^"]*)"\)', re.sub(r"//.*", "", text)))


def content(root: Path = ROOT, text: str | None = None, stated: dict | None = None) -> dict:
    """All that the document is made from: values, rows of the claims, figures.

    Raises
    ------
    ValueError
        If a number is typed in the words, if a name is unknown or unused, or if a result is missing.
    """
    text = TEXT.read_text(encoding="utf-8") if text is None else text
    stated = expanded(yaml.safe_load(VALUES.read_text(encoding="utf-8")) if stated is None else stated)
    if typed := typed_numbers(text):
        raise ValueError(f'report.typ has the typed numbers {", ".join(typed)}; write #v("name") and add the name')
    used = names_used(text)
    if unknown := sorted(used - stated.keys()):
        raise ValueError(f"report.typ uses {', '.join(unknown)}, which values.yaml does not have; add them there")
    if unused := sorted(stated.keys() - used):
        raise ValueError(f"values.yaml has {', '.join(unused)}, which report.typ does not use; take them out")
    found = read_entries(root / "book" / "claims.yaml", root / "experiments", RULES)
    entries = {entry.claim["id"]: entry for entry in found}
    values = {name: value_of(name, entry, root, entries) for name, entry in stated.items()}
    claims = claim_rows(found)
    statuses = Counter(row["status"] for row in claims).most_common()
    figures = sorted(set(re.findall(r'figure-of\("([^"]*)"', text)))
    dates = [read_results(file)["date"] for file in (root / "experiments").glob("**/results.json")]
    sources = [*values.values(), *(row["source"] for row in claims)]
    return {
        "values": values,
        "claims": claims,
        "statuses": statuses,
        "sources": sorted(sources, key=lambda row: (row["file"], row["key"])),
        "figures": {place: stored_figure(root / "notebooks", place) for place in figures},
        "date": max(dates),
    }


def write_report(to: Path = PDF, root: Path = ROOT) -> Path:
    """Typeset the report."""
    found = content(root)
    day = datetime.datetime.fromisoformat(found["date"]).replace(tzinfo=datetime.UTC)
    to.parent.mkdir(parents=True, exist_ok=True)
    pdf = typst.compile(
        TEXT,
        root=ROOT,
        sys_inputs={"content": json.dumps(found)},
        ignore_system_fonts=True,
        timestamp=day,
        format="pdf",
    )
    with whole_file(to) as temporary:
        temporary.write_bytes(pdf)
    return to


def n_pages(pdf: Path) -> int:
    """The number of pages of a PDF by Typst."""
    return int(re.search(rb"/Type/Pages/Count (\d+)", pdf.read_bytes())[1])


if __name__ == "__main__":
    made = write_report(Path(sys.argv[1]) if len(sys.argv) > 1 else PDF)
    print(f"wrote {made}: {n_pages(made)} pages")
