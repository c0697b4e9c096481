"""The symbols of the book's mathematics: those that a text uses, and those that ``symbols.yaml`` explains.

The directive ``symbol-table`` shows the lines of a part.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

_FENCED = re.compile(r"^(`{3,}).*?^\1[ \t]*$", re.M | re.S)
_CODE = re.compile(r"`[^`\n]*`")
_MATH = re.compile(r"\$\$(.*?)\$\$|\$([^$]+)\$", re.S)
_BRACED = r"\{(?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*\}"
#: Words within a formula, names of functions, environments, and the d of an integral.
_WORDS = re.compile(
    rf"\\(?:text|operatorname|begin|end)\s*{_BRACED}|\\mathrm\s*(?:{_BRACED}|[A-Za-z])"
    r"|\\\\\[[^\]]*\]|\\,\s*d(?=[A-Za-z\\])|\\[\\,;:!| ]"
)
_UPRIGHT_SUB = re.compile(r"_\{\\mathrm\s*\{?(\w+)\}?\}")
_FONTS = r"\\(?:mathcal|mathbb|mathbf)\s*(?:\{[A-Za-z]\}|[A-Za-z])"
_MARKS = r"\\(?:widehat|hat|bar|tilde|overline)"
_GREEK = (
    "alpha|beta|gamma|delta|varepsilon|zeta|eta|theta|kappa|lambda|mu|nu|xi|pi|varrho|rho|sigma|tau|varphi|phi|chi|psi|"
    "omega|Gamma|Delta|Theta|Lambda|Sigma|Phi|Psi|Omega|ell|SW|W|CD|R"
)
_LETTER = rf"(?:{_FONTS}|\\(?:{_GREEK})(?![A-Za-z])|[A-Za-z])"
_SYMBOL = re.compile(
    rf"(?P<mark>{_MARKS}(?![A-Za-z]))?\s*(?P<open>\{{)?(?P<letter>{_LETTER})(?(open)\}})(?:\{{\}})?"
    rf"(?P<sub>'*\s*_\s*(?:{_BRACED}|\\[A-Za-z]+|.))?"
)
_COMMAND = re.compile(r"\\[A-Za-z]+|.", re.S)


def formulas(text: str) -> Iterator[str]:
    """The formulas of Markdown, without code."""
    for found in _MATH.finditer(_CODE.sub(" ", _FENCED.sub("\n\n", text))):
        yield found[1] or found[2]


def symbols_of(formula: str) -> Iterator[tuple[str, str]]:
    r"""Each symbol of a formula, bare and with its subscript, as ``("\\sigma", "\\sigma_b")``.

    A hat, a bar or a tilde belongs to the symbol. What stands in a subscript or in a word is none.
    """
    formula = _WORDS.sub(" ", _UPRIGHT_SUB.sub(r"_{\1}", formula))
    place = 0
    while place < len(formula):
        found = _SYMBOL.match(formula, place)
        if not found:
            place = _COMMAND.match(formula, place).end()
            continue
        mark, letter = found["mark"] or "", re.sub(r"[{}\s]", "", found["letter"])
        bare = f"{mark}{letter}" if not mark or letter.startswith("\\") else f"{mark}{{{letter}}}"
        sub = re.sub(r"[{}\s'_]|\\(?:mathrm|text)", "", found["sub"] or "")
        yield bare, f"{bare}_{sub}" if sub else bare
        place = found.end()


class Line(NamedTuple):
    """One line of the table: symbols that are explained together, and where they are used."""

    symbols: str
    meaning: str
    code: str
    places: dict[str, list[str]]

    @classmethod
    def of(cls, line: dict) -> "Line":
        """From the YAML; ``places`` has for each symbol its chapters, or the beginnings of its headings."""
        places = line.get("chapters", line.get("in", []))
        keys = [key for _, key in symbols_of(line["symbol"])]
        own = {next(symbols_of(key))[1]: where for key, where in places.items()} if isinstance(places, dict) else {}
        return cls(line["symbol"], line["meaning"], line.get("code", ""), {key: own.get(key, places) for key in keys})


class Part(NamedTuple):
    """A part of the book."""

    title: str
    chapters: list[str]
    symbols: list[Line]
    local: dict[str, list[Line]]


class Table(NamedTuple):
    """All symbols."""

    everywhere: list[Line]
    parts: list[Part]
    unlisted: list[str]

    @classmethod
    def of(cls, read: dict) -> "Table":
        """From the YAML."""
        parts = [
            Part(
                part["title"],
                part["chapters"],
                [Line.of(line) for line in part["symbols"]],
                {chapter: [Line.of(line) for line in lines] for chapter, lines in part.get("local", {}).items()},
            )
            for part in read["parts"]
        ]
        return cls([Line.of(line) for line in read["everywhere"]], parts, read.get("unlisted", []))

    def doubles(self) -> list[str]:
        """Symbols with two meanings within a part, and local letters that are symbols of their part."""
        found = []
        for part in self.parts:
            shared: dict[str, set[str]] = {}
            for line in [*self.everywhere, *part.symbols]:
                for key in line.places:
                    shared.setdefault(key, set()).add(line.meaning)
            local = [(key, line.meaning) for lines in part.local.values() for line in lines for key in line.places]
            found += [f"{key}: {'; '.join(sorted(meanings))}" for key, meanings in shared.items() if len(meanings) > 1]
            found += [f"{key}: {meaning}; {'; '.join(shared[key])}" for key, meaning in local if key in shared]
        return found

    def faults(self, chapter: str, text: str) -> list[str]:
        """What a chapter's formulas use and the table does not list for it, and the reverse."""
        part = next(part for part in self.parts if chapter in part.chapters)
        everywhere = {key for line in self.everywhere for key in line.places}
        shared = {key: chapters for line in part.symbols for key, chapters in line.places.items()}
        local: dict[str, list[str]] = {}
        for line in part.local.get(chapter, []):
            for key, headings in line.places.items():
                local.setdefault(key, []).extend(headings)
        found, used = [], set()
        for heading, section in sections(text):
            for bare, full in (symbol for formula in formulas(section) for symbol in symbols_of(formula)):
                key = next((k for k in (full, bare) if k in everywhere or k in shared or k in local), None)
                if key is None:
                    found.append(f"{full} is not listed")
                elif key in shared and chapter not in shared[key]:
                    found.append(f"{key} belongs to chapters {', '.join(shared[key])}")
                elif key in local:
                    inside = [start for start in local[key] if heading.startswith(start)]
                    used |= {(key, start) for start in inside}
                    if not inside:
                        found.append(f"{key} is local to {', '.join(local[key])} and stands under {heading}")
                used.add((key, chapter))
        due = {(key, chapter) for key, chapters in shared.items() if chapter in chapters}
        due |= {(key, start) for key, starts in local.items() for start in starts}
        return list(dict.fromkeys(found)) + [f"{key} is listed and not used" for key, _ in sorted(due - used)]

    def rows(self, title: str) -> list[str]:
        """The table of a part in Markdown, or of what means the same everywhere, which has no column of chapters."""
        part = next((part for part in self.parts if part.title == title), None)
        rows = [["symbol", "meaning", "in code", "chapters"], ["---"] * 4]
        for line in part.symbols if part else self.everywhere:
            code = f"`{line.code}`" if line.code else ""
            chapters = sorted({chapter for chapters in line.places.values() for chapter in chapters}) if part else []
            rows.append([f"${line.symbols}$", line.meaning, code, ", ".join(chapters)])
        return [f"| {' | '.join(row if part else row[:3])} |" for row in rows]


def sections(text: str) -> Iterator[tuple[str, str]]:
    """The text below each heading of level 2 or 3, with the heading; what stands before them has none."""
    heading = ""
    for piece in re.split(r"^(#{2,3} .*)$", _FENCED.sub("\n\n", text), flags=re.M):
        if re.match(r"#{2,3} ", piece):
            heading = piece.lstrip("# ")
        else:
            yield heading, piece


def read_table(path: Path) -> Table:
    """The table of a file."""
    return Table.of(yaml.safe_load(path.read_text(encoding="utf-8")))


class SymbolTable(SphinxDirective):
    """``{symbol-table} PART``: the symbols of a part, from ``symbols.yaml``; those of all parts for ``everywhere``."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """The table."""
        path = Path(__file__).parent / "symbols.yaml"
        self.env.note_dependency(str(path))
        rows = read_table(path).rows(self.arguments[0])
        holder = nodes.Element()
        self.state.nested_parse(StringList(rows, source=self.env.docname), self.content_offset, holder)
        return holder.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("symbol-table", SymbolTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
