"""Punctuation that stays with the formula, or the word of code, that it touches."""

import pytest
from docutils import nodes
from sphinx.addnodes import pending_xref

from punctuation_extension import hold


def shape(paragraph):
    """The parts of a paragraph: what is held together in brackets of angle."""
    return [
        f"<{part.astext()}>" if isinstance(part, nodes.inline) and "held" in part["classes"] else part.astext()
        for part in paragraph
    ]


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        ("for ", ". Then", ["for ", "<x.>", " Then"]),
        ("see (", "), and", ["see ", "<(x),>", " and"]),
        ("the ", "-th root", ["the ", "<x-th>", " root"]),
        ("", "’s graph", ["<x’s>", " graph"]),
        ("for ", " is", ["for ", "x", " is"]),
        ("for ", "-dimensional space", ["for ", "x", "-dimensional space"]),
        ("", ".", ["<x.>"]),
    ],
)
@pytest.mark.parametrize("kind", [nodes.math, nodes.literal])
def test_what_touches_is_held(kind, before, after, wanted):
    paragraph = nodes.paragraph()
    paragraph += [nodes.Text(before), kind("", "x"), nodes.Text(after)]
    hold(paragraph[1])
    assert [part for part in shape(paragraph) if part] == wanted


def test_a_formula_alone_in_emphasis_is_held_with_it():
    paragraph = nodes.paragraph("", "", nodes.emphasis("", "", nodes.math("", "x")), nodes.Text(", and"))
    hold(paragraph[0][0])
    assert shape(paragraph) == ["<x,>", " and"]
    assert isinstance(paragraph[0][0], nodes.emphasis)


def test_formulas_that_share_a_text_are_each_held():
    paragraph = nodes.paragraph(
        "", "", nodes.math("", "x"), nodes.Text(", then ("), nodes.math("", "y"), nodes.Text(").")
    )
    for formula in list(paragraph.findall(nodes.math)):
        hold(formula)
    assert shape(paragraph) == ["<x,>", " then ", "<(y).>"]


def test_a_link_to_a_name_of_the_api_is_held():
    link = pending_xref("", nodes.literal("f()", "f()"))
    paragraph = nodes.paragraph("", "", nodes.Text("as "), link, nodes.Text(". Then"))
    hold(link[0])
    assert shape(paragraph) == ["as ", "<f().>", " Then"]
