"""The plain notebook of a chapter: what is handed out, readable wherever notebooks are shown.

A chapter is written once, in MyST. Sphinx renders its page; this module writes its notebook, in the Markdown that
JupyterLab, Notebook, nbconvert, VS Code, Colab, nbviewer and GitHub know: no directive, no role, no macro of our own.
Sections, boxes, figures, tables and equations have the numbers of the page; a test compares them. Code and outputs stay
as they are.
"""

import functools
import re
from collections import Counter
from pathlib import Path

import jupytext
import nbformat
from pybtex.backends.markdown import Backend
from pybtex.database import BibliographyData, parse_file
from pybtex.richtext import Text
from pybtex.style.formatting.unsrt import Style

from conf import PUBLISHED, bibtex_bibfiles, mathjax3_config
from links_extension import MENTION
from numbers_extension import NUMBERED, PROVED, chapter_number
from quiz_extension import read_quiz
from reader_extension import FOLDED, count_reading

BOOK = Path(__file__).resolve().parent
CHAPTERS = BOOK.parent / "notebooks"
MACROS = mathjax3_config["tex"]["macros"]
#: The first three letters of a code cell's name -> what it shows.
SHOWN = {"fig": "Figure", "tab": "Table"}
_FENCE = r"^```[\s\S]*?^```$"
#: What gets a number.
_COUNTED = re.compile(
    rf"{_FENCE}|(?:^\((?P<target>[\w-]+)\)=\n)?^(?P<marks>#+) (?P<title>.*)$"
    r"|^:::\{prf:(?P<box>(?!proof)\w+)\}.*\n:label: (?P<label>.*)$"
    r"|^\$\$\n(?P<formula>(?:(?!\$\$)[\s\S])*)\$\$ \((?P<equation>[\w-]+)\)$",
    re.M,
)
_BOX = re.compile(
    rf"{_FENCE}|^:::\{{(?P<kind>[\w:]+)\}} *(?P<title>.*)\n(?P<options>(?::[\w-]+:.*\n)*)(?P<body>[\s\S]*?)^:::$", re.M
)
#: What a text holds besides plain words. In a heading only formulas change.
_INLINE = re.compile(
    rf"{_FENCE}|(?P<heading>^#+ .*$)|\{{(?P<role>[\w:]+)\}}`(?P<content>[^`]*)`|(?P<ticks>`+)[^`][\s\S]*?(?P=ticks)"
    rf"|(?P<math>\$\$[\s\S]*?\$\$|\$[^$]+\$)|\[(?P<words>[^\]]*)\]\((?P<leads>[^)\s]*)\)|(?P<mention>{MENTION.pattern})",
    re.M,
)
_MATH = re.compile(r"\$\$[\s\S]*?\$\$|\$[^$]+\$")
_MACRO = re.compile(rf"([_^]?)\\({'|'.join(MACROS)})(?![A-Za-z])")
_RAW = re.compile(rf"^ *:::.*|\{{[\w:-]+\}}`.*|^\([\w-]+\)=$|\\(?:{'|'.join(MACROS)})(?![A-Za-z])", re.M)


def source_notebook(source: Path) -> nbformat.NotebookNode:
    """The notebook of a text source, with cell ids that do not change from run to run."""
    notebook = jupytext.read(source)
    for index, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{index:03d}"
    return notebook


def plain_notebook(
    notebook: nbformat.NotebookNode, name: str, quizzes: Path = BOOK / "quizzes", *, answers: bool = True
) -> nbformat.NotebookNode:
    """A chapter in MyST, ``name`` as its file, as a plain notebook with the same code and outputs.

    Without ``answers``, the questions of the quiz stand alone.
    """
    chapter = Chapter(name, quizzes, answers)
    texts = [chapter.counted(cell) for cell in notebook.cells]  # first all numbers: text may refer to what follows
    cells, heading = [], ""
    for cell, text in zip(notebook.cells, texts, strict=True):
        if cell.cell_type == "markdown":
            cells.append(nbformat.v4.new_markdown_cell(chapter.plain(text), id=cell.id))
            heading = ""
            continue
        before, heading = heading, chapter.quiet_heading(cell)
        if heading and heading != before:
            cells.append(nbformat.v4.new_markdown_cell(heading, id=f"{cell.id}-head"))
        cells.append(_folded(cell))
        caption = chapter.caption(cell)
        if caption:
            cells.append(nbformat.v4.new_markdown_cell(caption, id=f"{cell.id}-caption"))
            heading = ""
    head = f"*{count_reading(notebook).head}*"
    if PUBLISHED:
        head += f" *[The page of this chapter]({PUBLISHED}/{name}.html) has more.*"
    cells[0]["source"] = re.sub(r"\A(.*(?:\n|\Z))", rf"\1\n{head}\n", cells[0].source)
    if chapter.cited:
        cells.append(nbformat.v4.new_markdown_cell(_references(chapter.cited), id="references"))
    for cell in cells:
        raw = _RAW.search(_outside_code(cell.source)) if cell.cell_type == "markdown" else None
        if raw:
            raise ValueError(f"{name}: {raw[0]!r} has no plain form; add one to book/plain.py, or write it another way")
    return nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": notebook.metadata.kernelspec})


def _folded(cell: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A code cell with the metadata by which front ends fold it, and nbconvert describes its picture."""
    metadata = dict(cell.metadata)
    ways = {FOLDED[tag][0] for tag in cell.metadata.get("tags", []) if tag in FOLDED}
    if ways:
        metadata["jupyter"] = {"source_hidden": True} | ({"outputs_hidden": True} if "hide-cell" in ways else {})
    alt = cell.metadata.get("mystnb", {}).get("image", {}).get("alt")
    if alt:
        metadata["alt"] = alt
    return nbformat.from_dict({**cell, "metadata": metadata})


def _outside_code(text: str) -> str:
    return re.sub(rf"{_FENCE}|(?<!\}})(`+)[^`][\s\S]*?\1", "", text, flags=re.M)


class Chapter:
    """Numbers of one chapter, and its text in plain Markdown."""

    def __init__(self, name: str, quizzes: Path = BOOK / "quizzes", answers: bool = True):
        self.name, self.quizzes, self.answers = name, quizzes, answers
        self.number = chapter_number(name)
        self.counts: Counter[str] = Counter()
        #: Label -> kind and number, such as ("Figure", "1.3").
        self.labels: dict[str, tuple[str, str]] = {}
        self.cited: set[str] = set()

    # Numbers

    def counted(self, cell: nbformat.NotebookNode) -> str:
        """The source of a cell with the numbers of its headings and equations, once its labels are noted."""
        if cell.cell_type == "markdown":
            return _COUNTED.sub(self._counted, cell.source)
        name = cell.metadata.get("mystnb", {}).get("figure", {}).get("name")
        if name:
            self._note(name, SHOWN[name[:3]])
        return cell.source

    def _note(self, label: str, kind: str) -> str:
        self.counts[kind] += 1
        self.labels[label] = (kind, f"{self.number}.{self.counts[kind]}")
        return self.labels[label][1]

    def _counted(self, found: re.Match) -> str:
        if found["marks"]:
            # The page numbers the chapter and its sections, and nothing below them.
            self.counts["Section"] += found["marks"] == "##"
            number = {"#": f"{self.number} ", "##": f"{self.number}.{self.counts['Section']} "}.get(found["marks"], "")
            if not found["target"]:
                return f"{found['marks']} {number}{found['title']}"
            self.labels[found["target"]] = ("Section", number.strip())
            return f"{_anchor(found['target'])}\n\n{found['marks']} {number}{found['title']}"
        if found["box"]:
            self._note(found["label"], found["box"].capitalize())
        if found["equation"]:
            number = self._note(found["equation"], "Equation")
            return f"{_anchor(found['equation'])}\n\n$$\n{found['formula']}\\tag{{{number}}}\n$$"
        return found[0]

    # Text

    def plain(self, text: str) -> str:
        """Text of a chapter in plain Markdown."""
        parts, done = [], 0
        for found in _BOX.finditer(text):
            if found["kind"]:
                parts += [_INLINE.sub(self._inline, text[done : found.start()]), self._box(found)]
                done = found.end()
        return "".join([*parts, _INLINE.sub(self._inline, text[done:])])

    def _inline(self, found: re.Match) -> str:
        if found["heading"]:
            return _MATH.sub(_expanded, found[0])
        if found["math"]:
            beside = f"{found.string[: found.start()][-1:]}{found.string[found.end() :][:1]}"
            if re.search(r"\w", beside) and not found["math"].startswith("$$"):
                raise ValueError(
                    f"{self.name}: {found[0]} touches a word, so that VS Code and GitHub show it as letters; write the "
                    r"word within the formula, as in $\text{mm}^p$"
                )
            return _expanded(found)
        if found["role"] == "cite:p":
            keys = found["content"].split(",")
            self.cited.update(keys)
            return "[{}]".format("; ".join(f"[{_names_and_year(key)}](#ref-{key})" for key in keys))
        if found["leads"]:
            return self._link(found["words"], found["leads"])
        return self._mention(found[0]) if found["mention"] else found[0]

    def _link(self, words: str, leads: str) -> str:
        if not leads.startswith("#"):
            page, n_pages = re.subn(r"\.md(?=#|$)", ".html", leads)
            if n_pages:
                return f"[{words}]({PUBLISHED}/{page})" if PUBLISHED else words
            return f"[{words}]({leads})"
        chapter = self if leads[1:] in self.labels else _chapter_of(leads[1:])
        kind, number = chapter.labels[leads[1:]]
        if words in (*NUMBERED, *PROVED, "Equation"):
            words = f"{words} ({number})" if kind == "Equation" else f"{words} {number}"
        return f"[{words}]({'' if chapter is self else _address(chapter.name)}{leads})"

    def _mention(self, text: str) -> str:
        """Chapters lead to their notebooks or pages, claims to the published ledger."""
        kind, plural, numbers = MENTION.fullmatch(text).groups()

        def link(number: str, words: str) -> str:
            if kind.lower() == "claim":
                return f"[{words}]({PUBLISHED}/ledger.html#claim-{number})" if PUBLISHED else words
            if int(number) not in _chapters():
                raise ValueError(f"{self.name}: there is no chapter {number}")
            return f"[{words}]({_address(_chapters()[int(number)])})"

        if plural:
            return text.removesuffix(numbers) + re.sub(r"\d+", lambda found: link(found[0], found[0]), numbers)
        first = re.match(r"\d+", numbers)[0]
        return link(first, text.removesuffix(numbers) + first) + numbers.removeprefix(first)

    # Boxes

    def _box(self, found: re.Match) -> str:
        kind, title = found["kind"], found["title"].strip()
        body = self.plain(found["body"].strip())
        if kind == "quiz":
            return self._quiz()
        if kind == "dropdown":
            return _details(title, body)
        if kind == "warning":
            return _quoted(f"**Warning.** {body}")
        if kind == "prf:proof":
            return _quoted(f"*Proof.* {body}")
        if kind.startswith("prf:"):
            label = re.search(r"^:label: (.*)$", found["options"], re.M)[1]
            name = " ".join(self.labels[label]) + (f" ({self.plain(title)})" if title else "")
            return _quoted(f"{_anchor(label)}**{name}.**\n\n{body}")
        return found[0]

    def _quiz(self) -> str:
        parts = []
        for number, question in enumerate(read_quiz(self.quizzes / f"{self.name}.yaml"), 1):
            letters = dict(zip("abcdefgh", question["answers"], strict=False))
            choices = [f"- **{letter}.** {self.plain(answer['answer'])}" for letter, answer in letters.items()]
            said = [
                f"- **{letter}** is {'right' if answer.get('right') else 'wrong'}. {self.plain(answer['because'])}"
                for letter, answer in letters.items()
            ]
            parts += [f"**Question {number}.** {self.plain(question['question'])}", "\n".join(choices)]
            parts += [_details(f"Answer to question {number}", "\n".join(said))] if self.answers else []
        return "\n\n".join(parts)

    # Code cells

    def quiet_heading(self, cell: nbformat.NotebookNode) -> str:
        """What stands above a code cell that is folded or shows a figure or table: a small line, and its anchor."""
        folded = [FOLDED[tag][1] for tag in cell.metadata.get("tags", []) if tag in FOLDED]
        name = cell.metadata.get("mystnb", {}).get("figure", {}).get("name")
        if name:
            return f"{_anchor(name)}*Code: {' '.join(self.labels[name])}*"
        return f"*{folded[0][0].upper()}{folded[0][1:]}*" if folded else ""

    def caption(self, cell: nbformat.NotebookNode) -> str:
        """What stands below a figure or table: number and caption, and for a picture its description."""
        shown = cell.metadata.get("mystnb", {})
        if "figure" not in shown:
            return ""
        text = f"**{' '.join(self.labels[shown['figure']['name']])}.** {self.plain(shown['figure']['caption'])}"
        alt = shown.get("image", {}).get("alt")
        return f"{text}\n\n{_details('The figure in words', alt)}" if alt else text


def _anchor(label: str) -> str:
    return f'<a id="{label}"></a>'


def _details(summary: str, body: str) -> str:
    return f"<details>\n<summary>{summary}</summary>\n\n{body}\n\n</details>"


def _quoted(text: str) -> str:
    """A quoted box. Each formula stands on one line: JupyterLab would take the marks of the box for a part of it."""
    one_line = _MATH.sub(lambda found: re.sub(r"\s*\n\s*", " ", found[0]), text)
    return "\n".join(f"> {line}".rstrip() for line in one_line.split("\n"))


def _expanded(found: re.Match) -> str:
    """A formula without the book's macros."""

    def expand(macro: re.Match) -> str:
        meaning = MACROS[macro[2]]
        return f"{macro[1]}{{{meaning}}}" if macro[1] else meaning

    return _MACRO.sub(expand, found[0])


@functools.cache
def _chapters() -> dict[int, str]:
    """Number of a chapter -> name of its file."""
    names = sorted(path.stem for path in CHAPTERS.glob("[0-9][0-9]_*.md"))
    return {chapter_number(name): name for name in names}


@functools.cache
def _chapter_of(label: str) -> "Chapter":
    """The chapter that has a label, with its numbers."""
    for name in _chapters().values():
        source = CHAPTERS / f"{name}.md"
        if label in source.read_text(encoding="utf-8"):
            chapter = Chapter(name)
            for cell in source_notebook(source).cells:
                chapter.counted(cell)
            if label in chapter.labels:
                return chapter
    raise ValueError(f"no chapter has the label {label!r}; write (#label) of a section, box, figure, table or equation")


def _address(name: str) -> str:
    """Where another chapter is read: its page where the book is published, the notebook beside this one elsewhere."""
    return f"{PUBLISHED}/{name}.html" if PUBLISHED else f"{name}.ipynb"


@functools.cache
def _bibliography() -> BibliographyData:
    return parse_file(BOOK / bibtex_bibfiles[0])


def _names_and_year(key: str) -> str:
    """Such as "Le et al., 2024"."""
    entry = _bibliography().entries[key]
    people = entry.persons.get("author") or entry.persons.get("editor") or []
    names = [str(Text(" ").join(person.rich_prelast_names + person.rich_last_names)) for person in people]
    if not names:
        return f"{key}, {entry.fields.get('year', '')}"
    if names[-1] == "others" or len(names) > 2:
        return f"{names[0]} et al., {entry.fields['year']}"
    return f"{' and '.join(names)}, {entry.fields['year']}"


def _references(keys: set[str]) -> str:
    """The list of references, by names and year."""
    style, backend = Style(), Backend("utf-8")
    lines = []
    for key in sorted(keys, key=lambda key: _names_and_year(key).lower()):
        entry = style.format_entry(key, _bibliography().entries[key])
        # pybtex escapes what means nothing within a sentence, and breaks lines.
        text = re.sub(r"\\([.():-])", r"\1", " ".join(entry.text.render(backend).split("\n")))
        lines.append(f"- {_anchor(f'ref-{key}')}{text}")
    return "\n".join(["## References", "", *lines])
