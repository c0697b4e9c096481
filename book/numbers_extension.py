"""Numbers: a chapter has the number of its file; sections, figures, tables, theorems and equations count within it.

A link whose text is a kind, such as ``[Figure](#fig-whirl)``, becomes "Figure 20.3". A code cell whose
``mystnb: figure: name`` begins with ``tab-`` shows a table, with its caption above.
"""

import re

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.environment.collectors.toctree import TocTreeCollector
from sphinx.transforms import SphinxTransform

CHAPTER = re.compile(r"(\d\d)_\w+")
NUMBERED = ("Figure", "Table", "Section")
PROVED = ("Theorem", "Definition", "Lemma", "Proposition", "Corollary", "Example", "Remark", "Algorithm", "Assumption")


class table_figure(nodes.figure):
    """A table that a code cell shows, with its caption."""


def chapter_number(docname: str) -> int | None:
    """The number of a chapter, from its file name."""
    found = CHAPTER.fullmatch(docname)
    return int(found[1]) if found else None


def number_chapters(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Put the chapter's own number first in the numbers that Sphinx has counted, and count what lies within anew."""
    for docname, numbers in env.toc_secnumbers.items():
        chapter = chapter_number(docname)
        if chapter is None:
            raise ValueError(f"{docname} is in a numbered table of contents, but its name is not NN_slug")
        env.toc_secnumbers[docname] = {anchor: number and (chapter, *number[1:]) for anchor, number in numbers.items()}
        env.titles[docname]["secnumber"] = (chapter,)
        for reference in env.tocs[docname].findall(nodes.reference):
            if reference.get("secnumber"):
                reference["secnumber"] = (chapter, *reference["secnumber"][1:])
    return TocTreeCollector().assign_figure_numbers(env)


class TableFigures(SphinxTransform):
    """Figures of code cells that are tables count as tables, and their captions stand above."""

    default_priority = 200

    def apply(self, **kwargs: object) -> None:
        """Exchange the nodes."""
        for figure in list(self.document.findall(nodes.figure)):
            if not any(name.startswith("tab-") for name in figure["names"]):
                continue
            captions = [child for child in figure if isinstance(child, nodes.caption)]
            others = [child for child in figure if not isinstance(child, nodes.caption)]
            table = table_figure("", *captions, *others, **figure.attributes)
            table.source, table.line = figure.source, figure.line
            figure.replace_self(table)
            for identifier in table["ids"]:
                self.document.ids[identifier] = table


class NumberedLinks(SphinxTransform):
    """Links whose text is a kind get the number of what they lead to. Before MyST resolves links to ids (879)."""

    default_priority = 870

    def apply(self, **kwargs: object) -> None:
        """Exchange the links."""
        for link in list(self.document.findall(nodes.reference)):
            kind = link.astext()
            if link.get("id_link") and (kind in (*NUMBERED, *PROVED, "Equation")):
                link.replace_self(self._numbered(kind, link["refuri"][1:]))

    def _numbered(self, kind: str, target: str) -> list[nodes.Node]:
        domain, role = ("std", "numref") if kind in NUMBERED else ("prf", "ref")
        before = []
        if kind == "Equation":
            (domain, role), before = ("math", "eq"), [nodes.Text("Equation ")]
        reference = pending_xref(
            "", nodes.inline("", target), refdoc=self.env.docname, refdomain=domain, reftype=role,
            reftarget=target, refexplicit=False, refwarn=True,
        )  # fmt: skip
        return [*before, reference]


class OwnIds(SphinxTransform):
    """The boxes of sphinx-proof all contain the same ids; an id has to be unique in its page."""

    default_priority = 200

    def apply(self, **kwargs: object) -> None:
        """Derive the id of a content from its box; a proof needs none."""
        for node in self.document.findall(nodes.Element):
            if node.get("ids") == ["proof-content"]:
                node["ids"] = [f"{node.parent['ids'][0]}-content"]
            elif node.get("ids") == ["proof"] and isinstance(node, nodes.admonition):
                node["ids"] = []


def visit_table_figure(self: nodes.NodeVisitor, node: table_figure) -> None:
    """Open a figure, in HTML."""
    self.visit_figure(node)


def depart_table_figure(self: nodes.NodeVisitor, node: table_figure) -> None:
    """Close it."""
    self.depart_figure(node)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the node, the transforms and the event."""
    app.add_enumerable_node(table_figure, "table", html=(visit_table_figure, depart_table_figure))
    for transform in (TableFigures, NumberedLinks, OwnIds):
        app.add_transform(transform)
    app.connect("env-get-updated", number_chapters)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
