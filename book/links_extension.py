"""Links that nobody writes: "chapter 12", "claims 7 and 12", and glossary words at their first use in a chapter."""

import re
from collections.abc import Iterator

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util import logging
from sphinx.util.nodes import make_refnode

from numbers_extension import chapter_number

logger = logging.getLogger(__name__)

MENTION = re.compile(r"\b([Cc]hapter|[Cc]laim)(s?)\s(\d+(?:(?:,\s(?:and\s)?|\sand\s|\sto\s|–)\d+)*)")
NO_LINK_WITHIN = (
    nodes.reference, pending_xref, nodes.title, nodes.literal, nodes.literal_block, nodes.raw, nodes.math,
    nodes.math_block, nodes.term, nodes.rubric,
)  # fmt: skip


def plain_texts(document: nodes.document) -> list[nodes.Text]:
    """The text in which links may be put, in reading order."""
    return [text for text in document.findall(nodes.Text) if not _within(text, NO_LINK_WITHIN)]


def _within(node: nodes.Node, kinds: tuple) -> bool:
    while node.parent is not None:
        node = node.parent
        if isinstance(node, kinds):
            return True
    return False


class Mentions(SphinxTransform):
    """Chapters and claims that are named by number become links."""

    default_priority = 870

    def apply(self, **kwargs: object) -> None:
        """Split the text around every mention."""
        if self.env.docname.startswith("api/"):
            return
        self.chapters = {chapter_number(name): name for name in self.env.found_docs if chapter_number(name)}
        for text in plain_texts(self.document):
            parts = list(self._linked(text.astext()))
            if len(parts) > 1:
                text.parent.replace(text, parts)

    def _linked(self, text: str) -> Iterator[nodes.Node]:
        done = 0
        for mention in MENTION.finditer(text):
            kind, plural, numbers = mention.groups()
            begin = mention.start(3) if plural else mention.start()
            yield nodes.Text(text[done:begin])
            if plural:
                for part in re.split(r"(\d+)", numbers):
                    yield self._link(kind, int(part), part) if part.isdigit() else nodes.Text(part)
            else:
                first = re.match(r"\d+", numbers)[0]
                yield self._link(kind, int(first), text[begin : mention.start(3)] + first)
                yield nodes.Text(numbers[len(first) :])
            done = mention.end()
        yield nodes.Text(text[done:])

    def _link(self, kind: str, number: int, words: str) -> nodes.Node:
        if kind.lower() == "claim":
            role, target = "ref", f"claim-{number}"
        elif number in self.chapters:
            role, target = "doc", "/" + self.chapters[number]
        else:
            logger.warning("there is no chapter %s", number, location=self.env.docname, type="ref", subtype="chapter")
            return nodes.Text(words)
        return pending_xref(
            "", nodes.inline("", words), refdoc=self.env.docname, refdomain="std", reftype=role,
            reftarget=target, refexplicit=True, refwarn=True,
        )  # fmt: skip


class GlossaryWords(SphinxPostTransform):
    """The first use of a glossary word in a chapter leads to its definition."""

    default_priority = 5  # before references are resolved (10), so that words within links are known

    def run(self, **kwargs: object) -> None:
        """Link, the longest word first where two begin at one place."""
        if chapter_number(self.env.docname) is None:
            return
        objects = self.env.domains["std"].objects
        places = {name.lower(): place for (kind, name), place in objects.items() if kind == "term"}
        for text in plain_texts(self.document):
            parts = list(self._linked(text.astext(), places))
            if len(parts) > 1:
                text.parent.replace(text, parts)

    def _linked(self, text: str, places: dict[str, tuple[str, str]]) -> Iterator[nodes.Node]:
        done = 0
        for found in _words(places).finditer(text) if places else ():
            if found[1].lower() not in places:  # linked above
                continue
            docname, anchor = places.pop(found[1].lower())
            yield nodes.Text(text[done : found.start()])
            link = make_refnode(self.app.builder, self.env.docname, docname, anchor, nodes.inline("", found[0]))
            link["classes"].append("glossary-word")
            yield link
            done = found.end()
        yield nodes.Text(text[done:])


def _words(places: dict) -> re.Pattern:
    names = "|".join(re.escape(name).replace(r"\ ", r"\s") for name in sorted(places, key=len, reverse=True))
    return re.compile(rf"(?<![\w-])({names})s?(?![\w-])", re.IGNORECASE)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register both transforms."""
    app.add_transform(Mentions)
    app.add_post_transform(GlossaryWords)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
