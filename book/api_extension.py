"""What Sphinx needs for the API pages: the pages themselves, short names of types, and source links for constants."""

import functools
import re
import types
import typing
from pathlib import Path

from docutils.nodes import Element
from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.typing import stringify_annotation

from api_pages import assignments, doors, set_formulas, write_pages


class DoorsDomain(PythonDomain):
    """Python's names, where the same class may be shown at two doors."""

    def note_object(
        self, name: str, objtype: str, node_id: str, aliased: bool = False, location: object = None
    ) -> None:
        """Keep a name; of two doors that show a class, the first stands for the module that defines it."""
        if not (aliased and name in self.objects):
            super().note_object(name, objtype, node_id, aliased, location)


@functools.cache
def _aliases() -> dict[str, str]:
    """The types that doors name, as autodoc spells them out, and their names."""
    kinds = (types.UnionType, types.GenericAlias, typing.Callable[[], None].__class__)
    entries = [entry for found in doors().values() for entry in found]
    return {
        stringify_annotation(entry.value, "smart"): f"~{entry.door}.{entry.name}"
        for entry in entries
        if isinstance(entry.value, kinds)
    }


def name_types(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str | None, result: str | None
):
    """A signature in which the types that have a name at a door go by it."""
    for spelt, alias in _aliases().items():
        signature = signature and signature.replace(spelt, alias)
        result = result and result.replace(spelt, alias)
    # The text of a factory or a lambda is no Python; Sphinx would show such a signature unread, without links.
    return signature and re.sub(r"<(?:[^<>]|<\w+>)*>", "...", signature), result


def defining_module(app: Sphinx, module: str, attribute: str) -> str | None:
    """The module whose source a name at a door comes from."""
    return next((entry.module for entry in doors().get(module, []) if entry.name == attribute), None)


def typeset(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Set the formulas of a docstring."""
    lines[:] = set_formulas(lines)


@functools.cache
def _source(module: str) -> tuple[str, dict]:
    analyzer = ModuleAnalyzer.for_module(module)
    analyzer.find_tags()
    constants = {name: ("other", at.first_line, at.last_line) for name, at in assignments(module).items()}
    return analyzer.code, constants | analyzer.tags


def source(app: Sphinx, module: str) -> tuple[str, dict] | None:
    """The source of a module of ours, and the lines of its functions, classes and constants."""
    return _source(module) if module.split(".")[0] in ("meshot", "meshot_book") else None


def plain_type(app: Sphinx, env: BuildEnvironment, node: Element, text: Element) -> Element | None:
    """The text of a type that no door shows; a reference that a docstring writes as a role has to resolve."""
    return text if "refwarn" not in node else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the domain and the events."""
    for extension in ("sphinx.ext.autodoc", "sphinx.ext.viewcode"):
        app.setup_extension(extension)
    app.add_domain(DoorsDomain, override=True)
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir) / "api"))
    app.connect("autodoc-process-signature", name_types)
    app.connect("autodoc-process-docstring", typeset, priority=400)  # before napoleon
    app.connect("missing-reference", plain_type)
    app.connect("viewcode-follow-imported", defining_module)
    app.connect("viewcode-find-source", source)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
