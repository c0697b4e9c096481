"""The code that a script or a function reaches, and a digest of it.

From a script, names are followed to the functions, classes and constants that they mean, through imports and through
the lazy doors (``__init__.pyi``), and from these to further ones. Only definitions in the script's folder, in
``experiments/trials`` and in ``src`` count. The digest is that of their syntax trees. It does not depend on comments,
docstrings, type hints of arguments, imports and files: code that is moved keeps its digest. What is named by a text
only, such as a system of surfaces, is not found; a task names it under ``code``.
"""

import ast
import dataclasses
import functools
import hashlib
from collections.abc import Iterable
from pathlib import Path

DIGITS = 16
#: What a module does when it is run as a script.
MAIN = "__main__"
_DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
_IMPORTS = (ast.Import, ast.ImportFrom)
#: Fields of syntax trees that change no number, or whether a name is read or written, which its place says.
_LEFT_OUT = {ast.arg: ("annotation",), ast.FunctionDef: ("returns",), ast.AsyncFunctionDef: ("returns",)}
_EVERYWHERE = ("ctx", "type_comment", "kind")


@dataclasses.dataclass(frozen=True)
class Place:
    """A definition in a module, or the module itself if there is no name."""

    module: str
    name: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class Module:
    """What a module binds: its definitions, what it imports, and statements that run whenever it is imported."""

    definitions: dict[str, list[ast.stmt]]
    imports: dict[str, Place]
    others: list[ast.stmt]


@dataclasses.dataclass(frozen=True, eq=False)
class Code:
    """The code that can be imported from a folder, or from one package in it only, and from what lies below it."""

    folder: Path
    below: "Code | None" = None
    only: str = ""

    def digest(self, starts: Iterable[str]) -> str:
        """The digest of all that is reached from these modules and dotted names."""
        found = self.reached(starts)
        lines = sorted(f"{place.name} {text}" for place, text in found.items())
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:DIGITS]

    def reached(self, starts: Iterable[str]) -> dict[Place, str]:
        """The syntax trees of all definitions that are reached, as texts."""
        todo = [place for start in starts for place in self._begin(start)]
        found: dict[Place, str] = {}
        while todo:
            if (place := todo.pop()) not in found:
                found[place], more = self._read(place)
                todo += more
        return {place: text for place, text in found.items() if text}

    def _begin(self, start: str) -> list[Place]:
        """Everything in a module, or what a dotted name means."""
        if module := self.module(start):
            return [Place(start), *(Place(start, name) for name in module.definitions)]
        head, _, name = start.rpartition(".")
        found = self.find(head, name) if self.module(head) else None
        if found is None:
            raise ValueError(f"there is no code {start}; name a module, or what a door shows")
        return [found]

    @functools.cache  # noqa: B019
    def module(self, name: str) -> Module | None:
        """A module by its dotted name, or nothing if it is none of ours."""
        path = self.folder.joinpath(*name.split("."))
        package = (path / "__init__.py").is_file()
        files = [path / "__init__.py", path / "__init__.pyi"] if package else [path.with_suffix(".py")]
        if not files[0].is_file() or self.only not in ("", name.split(".")[0]):
            return self.below.module(name) if self.below else None
        lines = [line for file in files if file.is_file() for line in ast.parse(file.read_bytes()).body]
        return _module(lines, name, package)

    @functools.cache  # noqa: B019
    def find(self, module: str, name: str) -> Place | None:
        """The definition or module that a name in a module means, if it is one of ours."""
        known = self.module(module)
        if known is None:
            return None
        if name in known.definitions:
            return Place(module, name)
        if known.imports.get(name, Place(module, name)) != Place(module, name):
            return self._resolved(known.imports[name])
        return self._resolved(Place(f"{module}.{name}"))

    def _resolved(self, place: Place) -> Place | None:
        if place.name:
            return self.find(place.module, place.name)
        return place if self.module(place.module) else None

    @functools.cache  # noqa: B019
    def _read(self, place: Place) -> tuple[str, list[Place]]:
        """The syntax tree of a definition as a text, and what it refers to."""
        module = self.module(place.module)
        if self.below and module is self.below.module(place.module):
            return self.below._read(place)
        assert module is not None
        nodes = module.definitions[place.name] if place.name else module.others
        local = _imported([line for node in nodes for line in ast.walk(node)], place.module, package=False)
        found: dict[Place, None] = {}

        def meant(node: ast.expr) -> Place | None:
            if isinstance(node, ast.Attribute):
                base = meant(node.value)
                return self.find(base.module, node.attr) if base and not base.name else None
            if not isinstance(node, ast.Name):
                return None
            return self._resolved(local[node.id]) if node.id in local else self.find(place.module, node.id)

        def text(node: object) -> str:
            if isinstance(node, list):
                return f"[{' '.join(text(item) for item in node if not isinstance(item, _IMPORTS))}]"
            if not isinstance(node, ast.AST):
                return repr(node)
            if isinstance(node, (ast.Name, ast.Attribute)) and (target := meant(node)) and target.name:
                found[target] = None
                return target.name
            if isinstance(node, ast.Name):  # alike whether the module has a definition of this name, too
                return node.id
            left_out = (*_EVERYWHERE, *_LEFT_OUT.get(type(node), ()))
            fields = [(name, value) for name, value in ast.iter_fields(node) if name not in left_out]
            fields = [(name, _without_docstring(value) if name == "body" else value) for name, value in fields]
            parts = [f"{name}={text(value)}" for name, value in fields if value is not None and value != []]
            return f"{type(node).__name__}({' '.join(parts)})"

        # A module that is imported also runs its statements that bind no name.
        return text(nodes) if nodes else "", [*found, *([Place(place.module)] if place.name else [])]


def _without_docstring(body: object) -> object:
    if isinstance(body, list) and body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
        return body[1:] if isinstance(body[0].value.value, str) else body
    return body


def _module(lines: list[ast.stmt], name: str, package: bool) -> Module:
    """What the statements of a module bind."""
    definitions: dict[str, list[ast.stmt]] = {}
    others: list[ast.stmt] = []
    for line in lines:
        if isinstance(line, _IMPORTS) or (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)):
            continue
        if isinstance(line, ast.If) and "TYPE_CHECKING" in ast.unparse(line.test):
            continue
        if isinstance(line, ast.If) and "__name__" in ast.unparse(line.test):
            definitions[MAIN] = [line]
            continue
        inner = [line] if isinstance(line, _DEFINITIONS) else list(ast.walk(line))
        bound = {part.name for part in inner if isinstance(part, _DEFINITIONS)}
        bound |= {part.id for part in inner if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
        for each in sorted(bound):
            definitions.setdefault(each, []).append(line)
        if not bound:
            others.append(line)
    return Module(definitions, _imported(lines, name, package), others)


def _imported(nodes: Iterable[ast.AST], module: str, package: bool) -> dict[str, Place]:
    """The names that imports bind."""
    found: dict[str, Place] = {}
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                found[alias.asname or alias.name.split(".")[0]] = Place(
                    alias.name if alias.asname else alias.name.split(".")[0]
                )
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")
            above = above[: len(above) - node.level + package] if node.level else []
            source = ".".join([*above, *filter(None, [node.module])])
            found |= {alias.asname or alias.name: Place(source, alias.name) for alias in node.names}
    return found
