"""Keep a formula or a word of code on one line with the punctuation that touches it.

A browser may break a line beside a formula, since it is a box and not a letter. A full stop would then begin a line.
"""

import re

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

BEFORE = re.compile(r"[(\[“‘]+$")
AFTER = re.compile(r"(?:[-‑’]\w{1,3}\b|[.,;:!?)\]”’%])+")
#: Of a word of code that may not break, in characters; a line has some forty of them on a telephone.
LONGEST_CODE = 24
#: What may stand around them alone. A link to a name of the API is pending until all pages are read.
INLINE = (nodes.emphasis, nodes.strong, nodes.reference, nodes.inline, pending_xref)


class HeldPunctuation(SphinxTransform):
    """Put formulas, and short words of code, into one unbreakable piece with what touches them."""

    default_priority = 900  # after smart quotes and after the links that are put into texts

    def apply(self, **kwargs: object) -> None:
        """Wrap every formula and every short word of code that touches punctuation."""
        for node in [*self.document.findall(nodes.math), *self.document.findall(nodes.literal)]:
            if isinstance(node, nodes.math) or len(node.astext()) <= LONGEST_CODE:
                hold(node)


def hold(node: nodes.Node) -> None:
    """Wrap a node with the punctuation before and after it, if there is any."""
    while isinstance(node.parent, INLINE) and len(node.parent) == 1:
        node = node.parent
    parent, place = node.parent, node.parent.index(node)
    before, opening = _split(parent, place - 1, BEFORE)
    after, closing = _split(parent, place + 1, AFTER)
    if not opening and not closing:
        return
    piece = nodes.inline("", "", classes=["held"])
    first, end = place - bool(opening), place + 1 + bool(closing)
    parent[first:end] = [piece]
    piece += [*([nodes.Text(opening)] if opening else []), node, *([nodes.Text(closing)] if closing else [])]
    for text, where in ((after, first + 1), (before, first)):
        if text:
            parent.insert(where, nodes.Text(text))


def _split(parent: nodes.Element, place: int, touching: re.Pattern) -> tuple[str, str]:
    """The text at a place of a parent: what stays, and what touches. Both are empty if there is no text or no match."""
    if not 0 <= place < len(parent) or not isinstance(parent[place], nodes.Text):
        return "", ""
    text = parent[place].astext()
    found = touching.search(text) if touching is BEFORE else touching.match(text)
    if not found:
        return "", ""
    return text[: found.start()] + text[found.end() :], found[0]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(HeldPunctuation)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
