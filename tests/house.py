"""The house read from the syntax tree: which file imports what, by which door, and what each door shows."""

import ast
import re
from pathlib import Path

#: Folder or module of ``meshot`` -> rank; imports point to lower ranks only.
RANKS = {
    "_kernels": 0, "extras": 0, "types": 0, "rng": 0, "errors": 0, "files": 0, "workers": 0, "settings": 0,
    "provenance": 0, "statistics": 0, "file_facts": 0,
    "mesh": 1,
    "volume": 2, "measure": 2,
    "metrics": 3, "loss": 3, "train": 3,
    "flow": 4, "anatomy": 4,
    "synth": 5, "model": 5, "view": 5,
    "systems": 6,
    "pipeline": 7,
    "": 7,  # the front door itself, which only the command line goes through
    "study": 8,
    "cli": 9,
    "__main__": 10,
}  # fmt: skip
#: The same of ``meshot_book``, which may import all of ``meshot`` besides.
BOOK_RANKS = {
    "notebook": 0, "examples": 0, "live": 0, "measurements": 0, "statistics": 0, "lines": 0,
    "flows": 0, "defects": 0, "example_file": 0, "tissue": 0,
    "figures": 1, "exercises": 1, "claims": 1, "trainings": 1,
    "marks": 2,
}  # fmt: skip

#: Where a folder may import less than its rank allows.
NARROWER = {"metrics": {"mesh", "volume"} | {name for name, rank in RANKS.items() if rank == 0}}

#: Library -> the folders or modules (prefixes, relative to src) that may import it.
HOMES = {
    "trimesh": ("meshot/mesh/io", "meshot/mesh/mesh"),
    "nibabel": ("meshot/mesh/io", "meshot/volume/io"),
    "SimpleITK": ("meshot/volume/registration",),
    "skimage": ("meshot/volume/",),
    "igl": ("meshot/mesh/", "meshot/metrics/"),
    "ot": ("meshot/loss/", "meshot/metrics/"),
    "geomloss": ("meshot/loss/", "meshot/metrics/"),
    "torchdiffeq": ("meshot/flow/integration",),
    "nilearn": ("meshot/anatomy/",),
    "pyvista": ("meshot/mesh/mesh", "meshot/view/", "meshot_book/figures/"),
    "vtk": ("meshot/view/", "meshot_book/figures/"),
    "vtkmodules": ("meshot/view/", "meshot_book/figures/"),
    "matplotlib": ("meshot/view/", "meshot_book/figures/", "meshot_book/live/"),
    "bidsschematools": ("meshot/study/bids",),
    "pathspec": ("meshot/study/bids",),
    "filelock": ("meshot/files", "meshot_book/trainings/"),
    "pooch": ("meshot_book/notebook/",),
    "IPython": ("meshot_book/figures/",),
    "jinja2": ("meshot/view/page",),
    "yaml": ("meshot/settings", "meshot/synth/recipe", "meshot_book/claims/"),
}


def imports(source: str) -> list[tuple[str, str]]:
    """Module and name of everything that a piece of code imports, wherever in it; the name is empty for a module."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            # A relative import would hide the layer.
            found += [("." * node.level + (node.module or ""), alias.name) for alias in node.names]
    return found


def cells(chapter: str) -> str:
    """The code of a chapter's source, without the options of its cells and without magic commands."""
    code = "\n".join(re.findall(r"```\{code-cell\}[^\n]*\n(?:---\n.*?\n---\n|(?::[^\n]*\n)*)(.*?)```", chapter, re.S))
    return re.sub(r"^(\s*)[%!].*$", r"\1pass", code, flags=re.M)


def breaches(src: Path) -> list[str]:
    """What the packages in ``src`` import against rank, door or home."""
    found = []
    for file in sorted(src.rglob("*.py")):
        package, *inside = file.relative_to(src).with_suffix("").parts
        ranks = {"meshot": RANKS, "meshot_book": BOOK_RANKS}[package]
        if inside[0] == "__init__":
            continue
        place = file.relative_to(src).as_posix()
        if inside[0] not in ranks:
            found.append(f"{place}: no layer {inside[0]}")
            continue
        for module, name in imports(file.read_text(encoding="utf-8")):
            found += [f"{place} {trouble}" for trouble in _troubles(src, place, package, inside[0], module, name)]
    return found


def _troubles(src: Path, place: str, package: str, room: str, module: str, name: str) -> list[str]:
    top, *rest = module.split(".")
    if top == "":
        return ["has a relative import"]
    if top not in ("meshot", "meshot_book"):
        return _far_from_home(place, top)
    other = rest[0] if rest else name
    if top == package and other == room:
        return []
    if top == package:
        ranks = RANKS if package == "meshot" else BOOK_RANKS
        allowed = NARROWER.get(room, set()) if package == "meshot" and room in NARROWER else {
            o for o in ranks if ranks[o] < ranks[room] or ranks[o] == 0
        }  # fmt: skip
        if other not in allowed:
            return [f"imports {module}.{name}, which is not below it"]
    elif package == "meshot":
        return [f"imports {module}: the library knows nothing of the book"]
    return [] if is_door(src, module, name) else [f"imports {module}.{name} past its door"]


def _far_from_home(place: str, top: str) -> list[str]:
    if top in ("numba", "llvmlite") and not Path(place).name.startswith("_kernel"):
        return [f"imports {top} outside a _kernel file"]
    if top in HOMES and not place.startswith(HOMES[top]):
        return [f"imports {top}, whose home is {', '.join(HOMES[top])}"]
    return []


def is_door(src: Path, module: str, name: str) -> bool:
    """Whether a name may be imported from a module from outside: a door shows it, or the room is a single file."""
    place = src.joinpath(*module.split("."))
    if not place.is_dir():
        return len(module.split(".")) == 2
    if (place / name).is_dir() or (len(module.split(".")) == 1 and (place / f"{name}.py").is_file()):
        return True
    stub = place / "__init__.pyi"
    return name in shown_names(stub) if stub.is_file() else not (place / f"{name}.py").is_file()


def outside_breaches(src: Path, code: str) -> list[str]:
    """What a notebook or a script imports past a door."""
    ours = [(m, n) for m, n in imports(code) if m.split(".")[0] in ("meshot", "meshot_book")]
    return [f"{module}.{name}" for module, name in ours if not is_door(src, module, name)]


def shown_names(stub: Path) -> list[str]:
    """The names that a door shows."""
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    imported = [name for module, name in imports(stub.read_text(encoding="utf-8")) if module != "."]  # not its rooms
    return imported + [node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)]
