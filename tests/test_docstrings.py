"""Docstrings name every argument once, and no others."""

import ast
from collections.abc import Iterator

import pytest

HEAD = "Parameters"


def named(text: str) -> list[str] | None:
    """The names in the section on parameters; None if there is no such section."""
    lines = text.splitlines()
    if HEAD not in lines:
        return None
    names = []
    for line, below in zip(lines[lines.index(HEAD) + 2 :], [*lines[lines.index(HEAD) + 3 :], ""], strict=True):
        if below.startswith("---"):
            break
        if line and not line.startswith(" "):
            names += [name.strip().lstrip("*") for name in line.split(" : ")[0].split(",")]
    return names


def arguments(node: ast.FunctionDef | ast.ClassDef) -> list[str]:
    """The arguments of a function, or of the class: those of ``__init__``, or the fields of a dataclass."""
    if isinstance(node, ast.ClassDef):
        inits = [part for part in node.body if isinstance(part, ast.FunctionDef) and part.name == "__init__"]
        if inits:
            return arguments(inits[0])
        fields = [part for part in node.body if isinstance(part, ast.AnnAssign)]
        return [field.target.id for field in fields if "ClassVar" not in ast.unparse(field.annotation)]
    a = node.args
    every = [*a.posonlyargs, *a.args, *([a.vararg] if a.vararg else []), *a.kwonlyargs, *([a.kwarg] if a.kwarg else [])]
    return [each.arg for each in every if each.arg not in ("self", "cls")]


def wrong(source: str) -> Iterator[str]:
    """The functions and classes whose section on parameters does not list the arguments."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = named(ast.get_docstring(node) or "")
            if names is not None and sorted(names) != sorted(arguments(node)):
                yield f"{node.name} has {arguments(node)}, and its docstring names {names}"


def test_every_argument_is_named_once(root):
    found = {
        str(path.relative_to(root)): list(wrong(path.read_text(encoding="utf-8")))
        for path in (root / "src").rglob("*.py")
    }
    assert len(found) > 100
    assert {path: lines for path, lines in found.items() if lines} == {}


TEXT = '''
def area(mesh, /, radius=1, *others, unit="mm"):
    """The area.

    Parameters
    ----------
    mesh : Mesh
    radius, unit : float, str
        In mm.
    *others : Mesh

    Returns
    -------
    float
    """
'''


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("radius, unit : float", "radius : float"),
        ("mesh : Mesh", "mesh : Mesh\n    mesh : Mesh"),
        ("    *others : Mesh", "    *more : Mesh"),
    ],
)
def test_what_is_missing_doubled_or_strange_is_seen(old, new):
    assert list(wrong(TEXT)) == []
    assert TEXT.count(old) == 1
    assert len(list(wrong(TEXT.replace(old, new)))) == 1
