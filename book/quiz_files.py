"""The quizzes for learning platforms: a file in Moodle's GIFT for each chapter, and one package in QTI 2.1.

Formulas stand between the marks of MathJax, ``\\(...\\)``, which Moodle and most players of QTI show.
"""

import html
import io
import re
import zipfile
from pathlib import Path

import jinja2
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

from plain import BOOK, CHAPTERS, Chapter, source_notebook
from quiz_extension import read_quiz

LETTERS = "ABCDEFGH"
#: What means something in GIFT, besides braces: escaped braces end an answer for some readers, so that they are written
#: as HTML does.
_GIFT = re.compile(r"[\\~=#:]")
_BRACES = str.maketrans({"{": "&#123;", "}": "&#125;"})
_MARKDOWN = MarkdownIt("commonmark", {"xhtmlOut": True}).use(
    dollarmath_plugin,
    renderer=lambda formula, options: (r"\[{}\]" if options["display_mode"] else r"\({}\)").format(
        html.escape(formula)
    ),
)


def quiz_files(quizzes: Path = BOOK / "quizzes") -> dict[str, str | bytes]:
    """The name of each file -> its text or bytes."""
    chapters = {source.stem: _questions(source, quizzes) for source in sorted(CHAPTERS.glob("[0-9][0-9]_*.md"))}
    files: dict[str, str | bytes] = {f"gift/{name}.gift": _gift(name, asked) for name, asked in chapters.items()}
    return files | {"meshes_as_measures_qti.zip": _qti(chapters)}


def _questions(source: Path, quizzes: Path) -> list[dict]:
    """The questions of a chapter in XHTML, without links: they would lead nowhere."""
    chapter = Chapter(source.stem, quizzes)
    for cell in source_notebook(source).cells:
        chapter.counted(cell)  # text may refer to figures by their numbers

    def shown(text: str) -> str:
        return _MARKDOWN.renderInline(re.sub(r"\[([^\]]*)\]\([^)\s]*\)", r"\1", chapter.plain(str(text))))

    return [
        {
            "question": shown(question["question"]),
            "answers": [
                {"letter": letter, "right": bool(answer.get("right"))}
                | {key: shown(answer[key]) for key in ("answer", "because")}
                for letter, answer in zip(LETTERS, question["answers"], strict=False)
            ],
        }
        for question in read_quiz(quizzes / f"{source.stem}.yaml")
    ]


def _gift(name: str, questions: list[dict]) -> str:
    def safe(text: str) -> str:
        return _GIFT.sub(r"\\\g<0>", " ".join(text.split()).translate(_BRACES))

    parts = [f"$CATEGORY: Meshes as Measures/{name}"]
    for number, question in enumerate(questions, 1):
        lines = [
            f"\t{'=' if answer['right'] else '~'}{safe(answer['answer'])}#{safe(answer['because'])}"
            for answer in question["answers"]
        ]
        parts.append("\n".join([f"::{name} {number}::[html]{safe(question['question'])}{{", *lines, "}"]))
    return "\n\n".join(parts) + "\n"


def _qti(chapters: dict[str, list[dict]]) -> bytes:
    """A package of items, as a zip whose bytes depend on the questions alone."""
    templates = jinja2.Environment(loader=jinja2.FileSystemLoader(BOOK / "assets"), trim_blocks=True)
    items = {
        f"q{name}_{number}": (f"{name} {number}", question)
        for name, questions in chapters.items()
        for number, question in enumerate(questions, 1)
    }
    texts = {"imsmanifest.xml": templates.get_template("qti_manifest.xml").render(items=items)}
    for identifier, (title, question) in items.items():
        texts[f"{identifier}.xml"] = templates.get_template("qti_item.xml").render(
            identifier=identifier, title=title, **question
        )
    package = io.BytesIO()
    with zipfile.ZipFile(package, "w", zipfile.ZIP_DEFLATED) as into:
        for file, text in texts.items():
            into.writestr(zipfile.ZipInfo(file, (2026, 1, 1, 0, 0, 0)), text, zipfile.ZIP_DEFLATED)
    return package.getvalue()
