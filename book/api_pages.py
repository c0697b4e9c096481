"""The API pages of the book, one for each door of the packages, written from the doors themselves.

A door is a package with a stub, ``__init__.pyi``, which says what the door shows, or a single file with ``__all__``.
Each name's own docstring says what it is. Nothing is listed here.
"""

import ast
import functools
import graphlib
import importlib
import inspect
import re
import textwrap
from pathlib import Path
from typing import NamedTuple

from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docstrings import prepare_docstring

import meshot

SRC = Path(meshot.__file__).parents[1]
#: How docstrings write a power -> the formula that a page shows.
FORMULAS = {
    r"\b(SW|W)_p\^p": r"\\\1_p^p",
    r"‖x − y‖₂\^p": r"\\lVert x - y \\rVert_2^p",
    r"‖x − y‖_p\^p": r"\\lVert x - y \\rVert_p^p",
    r"\bR\^([d\d])\b": r"\\R^\1",
    r"\((units of the \w+)\)\^p": r"(\\text{\1})^p",
    r"\bc·x\^s": r"c\\,x^s",
}


class Entry(NamedTuple):
    """A name at a door: the door, the name, and the module that defines it."""

    door: str
    name: str
    module: str

    @property
    def value(self) -> object:
        """The object itself."""
        return getattr(importlib.import_module(self.door), self.name)


@functools.cache
def doors() -> dict[str, list[Entry]]:
    """The doors of both packages, in the order in which rooms import each other, and the names that each shows."""
    found = {}
    for package in ("meshot", "meshot_book"):
        rooms = {folder.name for folder in (SRC / package).iterdir() if (folder / "__init__.py").is_file()}
        needed = {}
        for room in sorted(rooms):
            code = "".join(file.read_text(encoding="utf-8") for file in (SRC / package / room).rglob("*.py"))
            imported = re.findall(rf"^\s*(?:from|import) {package}\.(\w+)", code, re.MULTILINE)
            needed[room] = sorted(set(imported) & rooms - {room})
        for room in ("", *graphlib.TopologicalSorter(needed).static_order()):
            folder = SRC / package / room
            for stub in sorted([folder / "__init__.pyi"] if room == "" else folder.rglob("__init__.pyi")):
                if stub.is_file():
                    door = ".".join(stub.parent.relative_to(SRC).parts)
                    found[door] = _entries(door, ast.parse(stub.read_text(encoding="utf-8")))
        for file in sorted((SRC / package).glob("[a-z]*.py")):
            names = assignments(f"{package}.{file.stem}").get("__all__")
            if names:
                door = f"{package}.{file.stem}"
                entries = [Entry(door, name, door) for name in ast.literal_eval(names.value)]
                if any(inspect.isroutine(entry.value) for entry in entries):
                    found[door] = entries
    return found


def _entries(door: str, stub: ast.Module) -> list[Entry]:
    found = []
    for node in stub.body:
        if isinstance(node, ast.ImportFrom) and node.module:  # a module at a door has no entry of its own
            found += [
                Entry(door, alias.name, defining_module(f"{door}.{node.module}", alias.name)) for alias in node.names
            ]
        elif isinstance(node, ast.AnnAssign):
            found.append(Entry(door, node.target.id, door))
    return found


def defining_module(module: str, name: str) -> str:
    """The module whose source defines a name, when ``module`` may be a door that only shows it."""
    file = Path(importlib.import_module(module).__file__)
    stub = file.with_suffix(".pyi")
    if not stub.is_file():
        return module
    return next(entry.module for entry in _entries(module, ast.parse(stub.read_text("utf-8"))) if entry.name == name)


class Assignment(NamedTuple):
    """Where a module gives a value to a name, and the value as it is written there."""

    first_line: int
    last_line: int
    value: str


def assignments(module: str) -> dict[str, Assignment]:
    """The names that the statements of a module give a value to."""
    found = {}
    for node in ast.parse(ModuleAnalyzer.for_module(module).code).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            pairs = zip(target.elts, node.value.elts, strict=True) if several else [(target, node.value)]
            for name, value in pairs:
                found[ast.unparse(name)] = Assignment(node.lineno, node.end_lineno, ast.unparse(value))
    return found


def set_formulas(lines: list[str]) -> list[str]:
    """The lines of a docstring with its powers as formulas: a terminal shows W_p^p, and a page typeset mathematics.

    Examples and literals stay as they are.
    """
    found, in_example = [], False
    for line in lines:
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        parts = re.split(r"(``.*?``)", line)
        for pattern, formula in () if in_example else FORMULAS.items():
            parts[::2] = [re.sub(pattern, rf":math:`{formula}`", part) for part in parts[::2]]
        found.append("".join(parts))
    return found


def _lines_about(entry: Entry) -> list[str]:
    """The docstring of a function or class; the comment (``#:``) above anything else."""
    if inspect.isclass(entry.value) or inspect.isroutine(entry.value):
        return set_formulas(prepare_docstring(inspect.getdoc(entry.value) or ""))
    return set_formulas(ModuleAnalyzer.for_module(entry.module).find_attr_docs().get(("", entry.name), [""]))


def _directive(entry: Entry) -> str:
    path, value = f"{entry.door}.{entry.name}", entry.value
    if inspect.isclass(value):
        # The public methods and properties of this package that have a docstring.
        ours = [base for base in value.__mro__ if base.__module__.split(".")[0] in ("meshot", "meshot_book")]
        names = dict.fromkeys(name for base in ours for name in vars(base) if not name.startswith("_"))
        kinds = (property, classmethod, staticmethod)
        members = [
            name
            for name in names
            if isinstance(inspect.getattr_static(value, name), kinds) or inspect.isfunction(getattr(value, name))
            if inspect.getdoc(getattr(value, name))
        ]
        options = f"   :members: {', '.join(members)}\n" if members else ""
        return f".. autoclass:: {path}\n{options}"
    if inspect.isroutine(value):
        return f".. autofunction:: {path}\n"
    code = textwrap.shorten(assignments(entry.module)[entry.name].value, 300, placeholder=" …")
    about = textwrap.indent("\n".join(_lines_about(entry)), "   ")
    return f".. py:data:: {entry.name}\n   :value: {code}\n\n{about}\n"


def page(door: str, entries: list[Entry]) -> str:
    """The page of a door: its docstring, a table of its names, and every name."""
    about = inspect.getdoc(importlib.import_module(door))
    rows = ""
    for each in entries:
        # The first paragraph of what is said about a name, on one line.
        summary = re.split(r"\n\s*\n", "\n".join(_lines_about(each)).strip())[0].replace("\n", " ")
        rows += f"   * - :py:obj:`{each.name} <{door}.{each.name}>`\n     - {summary}\n"
    table = f".. list-table::\n   :widths: 40 60\n   :class: names\n\n{rows}"
    whole = "\n".join(_directive(entry) for entry in entries)
    return f"{door}\n{'=' * len(door)}\n\n.. py:module:: {door}\n\n{about}\n\n{table}\n{whole}"


def write_pages(into: Path) -> None:
    """Write one page for each door, and the table of them that the index includes."""
    found = doors()
    for door, entries in found.items():
        (into / f"{door}.rst").write_text(page(door, entries), encoding="utf-8")
    about = {door: inspect.getdoc(importlib.import_module(door)).partition("\n")[0] for door in found}
    rows = "".join(f"| [`{door}`]({door}.rst) | {line} | {len(found[door])} |\n" for door, line in about.items())
    toctree = "\n".join(["```{toctree}", ":hidden:", "", *found, "```"])
    (into / "doors.inc").write_text(f"| package | purpose | names |\n|---|---|---|\n{rows}\n{toctree}\n", "utf-8")
