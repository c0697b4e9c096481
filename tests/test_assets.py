"""Pages live in files: no markup in Python's strings, and every file of a page travels with the package."""

import ast
import re
from pathlib import Path

import pytest
from setuptools import Distribution

#: A string of more than this many characters, or of several lines, is no word in passing.
LONGEST = 120
MARKS = {
    "HTML": re.compile(
        r"</?(?:a|b|button|canvas|details|div|fieldset|figure|i|img|input|label|li|p|pre|script|span|style|svg|table|td|"
        r"th|tr|ul)\b[^<]*>|<!doctype",
        re.IGNORECASE,
    ),
    "JavaScript": re.compile(r"\bfunction\b[^`\n]*\)\s*\{|=>\s*[{(]|\bconst \w+ =|\bdocument\.|addEventListener"),
    "CSS": re.compile(r"[\w\])*]\s*\{\s*[a-z-]+\s*:\s*[^:{}\"']+;"),
}


def markup(source: str) -> list[str]:
    """What a piece of Python holds of HTML, JavaScript or CSS in strings of more than a line; docstrings are prose."""
    tree = ast.parse(source)
    prose = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None
    }
    found = []
    for node in ast.walk(tree):
        text = _text(node)
        if id(node) in prose or ("\n" not in text.strip() and len(text) <= LONGEST):
            continue
        found += [f"line {node.lineno}: {kind}" for kind, mark in MARKS.items() if mark.search(text)]
    return found


def _text(node: ast.AST) -> str:
    """The letters of a string, of an f-string, or of strings that are added up."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(map(_text, node.values))
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left) + _text(node.right)
    return ""


def test_no_python_file_holds_a_page(root):
    files = [file for part in ("src", "book", "tools", "experiments") for file in (root / part).rglob("*.py")]
    assert len(files) > 200
    assert [f"{f.relative_to(root)} {trouble}" for f in files for trouble in markup(f.read_text("utf-8"))] == []


@pytest.mark.parametrize(
    ("code", "seen"),
    [
        ('PAGE = """\n<div id="a">\n</div>\n"""', "HTML"),
        ("PAGE = '<p>' + " + repr("x" * 130), "HTML"),
        ('f"<figure>{1}</figure>\\n" + f"<p>{2}</p>"', "HTML"),
        ('SCRIPT = """(function () {\n  "use strict";\n"""', "JavaScript"),
        ('SCRIPT = """\nconst f = (x) => {\n};\n"""', "JavaScript"),
        ('STYLE = """\n.a { margin: 0; }\n.b {}\n"""', "CSS"),
    ],
)
def test_each_kind_of_markup_is_seen(code, seen):
    assert any(seen in trouble for trouble in markup(code))


@pytest.mark.parametrize(
    "code", ['"<b>one line</b>"', '"""About <b>b</b>.\n\nAnd { margin: 0; }."""', '"a < b\\nc > d"']
)
def test_words_are_no_markup(code):
    assert markup(code) == []


def test_every_file_of_a_page_is_in_the_wheel(root, monkeypatch):
    monkeypatch.chdir(root)
    distribution = Distribution()
    distribution.parse_config_files()
    command = distribution.get_command_obj("build_py")
    command.ensure_finalized()
    command.manifest_files = {}  # what the package names itself, not what git tracks
    folders = {package: command.get_package_dir(package) for package in command.packages}
    packed = {Path(name) for folder in folders.items() for name in command.find_data_files(*folder)}
    assets = {file.relative_to(root) for file in (root / "src").rglob("assets/*")}
    assert {file.suffix for file in assets} == {".html", ".css", ".js"}
    lists = {file.relative_to(root) for file in (root / "src").rglob("*.sha256")}
    assert len(lists) == 1
    assert (assets | lists) - packed == set()
