"""Pages from files: what is filled in is escaped, what is joined stands once, and every script starts in a browser."""

import json
import re

import jinja2
import pytest

from browser import page_file, watched_page
from meshot.mesh.shapes import icosphere
from meshot.view import page as pages
from meshot.view.page import filled, joined, live_page
from meshot.view.scene import interactive
from refusals import refuses

SCENE = "meshot/view/assets/surface_scene"


@pytest.fixture
def files(monkeypatch):
    """Files by name, instead of those of the packages."""
    texts = {}
    monkeypatch.setattr(pages, "_text", texts.__getitem__)
    return texts


def test_what_is_imported_comes_first_and_once(files):
    files["a/main.js"] = 'import { f } from "./f.js";\nimport {\n  g,\n  h,\n} from "../b/g.js";\nf(g, h);\n'
    files["a/f.js"] = 'import { g } from "../b/g.js";\n// Why.\nexport function f(x) {\n  return "export g";\n}\n'
    files["b/g.js"] = "export const g = 1;\nexport async function h() {}\n"
    assert joined("a/main.js", "b/g.js").splitlines() == [
        "const g = 1;",
        "async function h() {}",
        "function f(x) {",
        'return "export g";',
        "}",
        "f(g, h);",
    ]


def test_files_that_import_each_other_end(files):
    files["a.js"] = 'import { b } from "./b.js";\nexport const a = 1;\n'
    files["b.js"] = 'import { a } from "./a.js";\nexport const b = 2;\n'
    assert joined("a.js").splitlines() == ["const b = 2;", "const a = 1;"]


def test_styles_are_joined_too(files):
    files["a/a.css"] = '@import "../b.css";\n/* Why. */\n.a :is(b, i) {\n  color: red;\n}\n'
    files["b.css"] = '.b::before {\n  content: "/* kept */";\n}\n'
    assert joined("a/a.css") == '.b::before {\ncontent: "/* kept */";\n}\n.a :is(b, i) {\ncolor: red;\n}'


def test_a_template_that_misses_a_value_is_refused():
    with pytest.raises(jinja2.UndefinedError, match="'stem' is undefined"):
        filled("meshot/view/assets/page.html", id="a", kind="b", alt="c")


def test_numbers_that_json_does_not_know_are_refused():
    refuses("not JSON compliant", live_page, SCENE, {"low": [float("nan")]}, "", alt="", title="", still="", bar=None)


def test_data_cannot_close_the_script_and_words_cannot_open_a_tag():
    data = {"items": ["</script><b>", "<!--", "é & '"]}
    found = live_page(SCENE, data, "words", alt='"<i>', title="<u>", still="", bar=None)
    assert found.html.count("</script>") == 1
    assert not re.search("<!--|<[bui]>", found.html)
    assert json.loads(re.search(r"const data = (.*);\n", found.html)[1]) == data
    assert repr(found) == "words"
    assert found._repr_html_() == found.html


def test_the_name_of_a_page_tells_pages_apart():
    def name(alt, *items):
        found = live_page(SCENE, {"items": items}, "", alt=alt, title="", still="", bar=None)
        return re.search(r'id="(surface-scene-\w{12})"', found.html)[1]

    assert name("a", 1) == name("a", 1)
    assert len({name("a", 1), name("a", 2), name("b", 1)}) == 3


def scripts(root):
    names = sorted(file.relative_to(root / "src").as_posix() for file in (root / "src").rglob("assets/*.js"))
    assert len(names) > 15
    return names


def test_every_script_starts_without_a_complaint(root, tmp_path, context):
    parts = [f'<script>(() => {{\n"use strict";\n{joined(name)}\n}})();</script>' for name in scripts(root)]
    (tmp_path / "page.html").write_text("\n".join(["<!doctype html><meta charset=utf-8>", *parts]), encoding="utf-8")
    with watched_page(context, tmp_path / "page.html") as (_, troubles):
        assert troubles == []


@pytest.mark.parametrize("code", ["const a = 1;\nconst a = 2;", "function (", "undeclared = 1;"])
def test_a_script_that_does_not_start_is_seen(tmp_path, context, code):
    (tmp_path / "page.html").write_text(f'<script>(() => {{\n"use strict";\n{code}\n}})();</script>')
    with watched_page(context, tmp_path / "page.html") as (_, troubles):
        assert any("script error" in trouble for trouble in troubles)


def test_a_page_shown_twice_comes_to_life_once(tmp_path, context):
    """Notebooks run the script of an output again when they show it again."""
    found = interactive({"a": icosphere(0), "b": icosphere(1)}, alt="two spheres")
    path = page_file(tmp_path, found)
    path.write_text(path.read_text(encoding="utf-8").replace("</body>", found.html + "</body>"), encoding="utf-8")
    with watched_page(context, path) as (page, troubles):
        assert page.locator(".names").evaluate_all("e => e.map(x => x.childElementCount)") == [2, 0]
        assert troubles == []
