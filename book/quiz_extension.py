"""The directive ``quiz``: the questions of ``quizzes/NN_slug.yaml``, answered and explained in the page, offline.

Each question is a mapping of ``question`` and ``answers``; each answer has ``answer``, ``because``, and, for the one
that is right, ``right: true``. All three are Markdown.
"""

from pathlib import Path

import yaml
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FEWEST_ANSWERS = 3


def read_quiz(file: Path) -> list[dict]:
    """The questions of a file."""
    questions = yaml.safe_load(file.read_text(encoding="utf-8"))
    if not isinstance(questions, list) or not questions:
        raise ValueError(f"{file.name} holds no list of questions")
    for number, question in enumerate(questions, 1):
        trouble = _trouble(question)
        if trouble:
            raise ValueError(f"{file.name}, question {number}: {trouble}")
    return questions


def _trouble(question: object) -> str:
    if not isinstance(question, dict) or set(question) != {"question", "answers"}:
        return "the keys `question` and `answers` are needed, and no others"
    answers = question["answers"]
    if len(answers) < FEWEST_ANSWERS:
        return f"{len(answers)} answers; at least {FEWEST_ANSWERS} are needed"
    n_right = sum(answer.get("right", False) is True for answer in answers)
    if n_right != 1:
        return f"{n_right} answers are marked `right: true`; exactly one is needed"
    silent = [answer for answer in answers if not answer.get("answer") or not answer.get("because")]
    return f"an answer lacks `answer` or `because`: {silent[0]}" if silent else ""


class Quiz(SphinxDirective):
    """The questions that belong to the page."""

    def run(self) -> list[nodes.Node]:
        """The questions as a form."""
        file = Path(self.env.srcdir) / "quizzes" / f"{self.env.docname}.yaml"
        self.env.note_dependency(str(file))
        try:
            questions = read_quiz(file)
        except (ValueError, OSError) as error:
            raise self.error(f"quiz: {error}") from error
        box = nodes.container("", classes=["quiz"])
        for number, question in enumerate(questions, 1):
            box += self._question(number, question)
        box += _raw('<p class="quiz-score" role="status"></p>')
        return [box]

    def _question(self, number: int, question: dict) -> list[nodes.Node]:
        parts = [_raw('<fieldset class="quiz-question"><legend>'), nodes.strong("", f"{number}. ")]
        parts += [self._words(question["question"]), _raw("</legend>")]
        for answer in question["answers"]:
            right = "yes" if answer.get("right") else "no"
            parts.append(_raw(f'<div class="quiz-answer" data-right="{right}"><label>'))
            parts += [_raw(f'<input type="radio" name="question-{number}">'), self._words(answer["answer"])]
            parts += [_raw('</label><div class="quiz-because" hidden>'), self._words(answer["because"])]
            parts.append(_raw("</div></div>"))
        return [*parts, _raw('<p class="quiz-said" role="status"></p></fieldset>')]

    def _words(self, text: str) -> nodes.inline:
        """One paragraph of Markdown, without the paragraph around it."""
        holder = nodes.Element()
        self.state.nested_parse(StringList([str(text)], source=self.env.docname), self.content_offset, holder)
        return nodes.inline("", "", *(child for paragraph in holder.children for child in paragraph.children))


def _raw(text: str) -> nodes.raw:
    return nodes.raw("", text, format="html")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive and its files."""
    app.add_directive("quiz", Quiz)
    app.add_css_file("quiz.css")
    app.add_js_file("quiz.js")
    return {"parallel_read_safe": True, "parallel_write_safe": True}
