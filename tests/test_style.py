"""Habits of the package that a linter does not know: docstrings, annotations, named errors."""

import ast
from pathlib import Path

import pytest


def complaints(file: Path) -> list[str]:
    source = file.read_text(encoding="utf-8")
    tree = ast.parse(source)
    found = [f"{file.name}: no docstring"] if ast.get_docstring(tree) is None else []
    public_classes = [n for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
    functions = [(n, n.name) for n in tree.body if isinstance(n, ast.FunctionDef)]
    for owner in public_classes:
        found += [f"{owner.name}: no docstring"] if ast.get_docstring(owner) is None else []
        functions += [(n, f"{owner.name}.{n.name}") for n in owner.body if isinstance(n, ast.FunctionDef)]
    for function, name in functions:
        found += _function_complaints(function, name)
    # numba reads the types of a kernel's arguments from the call.
    return [f for f in found if not (file.name.startswith("_kernel") and "annotation" in f)]


def _function_complaints(function: ast.FunctionDef, name: str) -> list[str]:
    found = []
    if function.name.startswith("_"):
        return found
    text = ast.get_docstring(function) or ""
    if not text:
        found.append(f"{name}: no docstring")
    arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    bare = [a.arg for a in arguments if a.annotation is None and a.arg not in ("self", "cls")]
    found += [f"{name}: {argument} has no annotation" for argument in bare]
    raises = any(isinstance(n, ast.Raise) and _raised(n) == "ValueError" for n in ast.walk(function))
    if raises and "Raises" not in text and not any("property" in ast.dump(d) for d in function.decorator_list):
        found.append(f"{name}: raises ValueError, and does not say so")
    return found


def _raised(node: ast.Raise) -> str:
    call = node.exc
    return call.func.id if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) else ""


def test_the_package_keeps_its_habits(root):
    found = [f"{f.relative_to(root)}: {c}" for f in sorted((root / "src").rglob("*.py")) for c in complaints(f)]
    assert found == []


@pytest.mark.parametrize(
    ("code", "seen"),
    [
        ("def f(): ...", "no docstring"),
        ('"""d"""\ndef f(x): """d"""', "x has no annotation"),
        ('"""d"""\ndef f():\n    """d"""\n    raise ValueError("no")', "does not say so"),
        ('"""d"""\nclass A:\n    pass', "A: no docstring"),
    ],
)
def test_each_lapse_is_seen(tmp_path, code, seen):
    file = tmp_path / "a.py"
    file.write_text(code)
    assert any(seen in complaint for complaint in complaints(file))


def test_a_good_file_has_no_complaints(tmp_path):
    file = tmp_path / "a.py"
    file.write_text('"""d"""\n\n\ndef f(x: int) -> int:\n    """The number, again."""\n    return x\n')
    assert complaints(file) == []
