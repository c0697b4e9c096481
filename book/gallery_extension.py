"""The directive ``gallery``: every figure of the chapters, still and live, with its place and the cell that makes it.

Pictures, captions and questions are read from the stored notebooks that are rendered. ``concepts.yaml`` has the words
by which a figure belongs to a concept. Each code cell of a chapter gets an id, so that a link can lead to it.
"""

import base64
import io
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import NamedTuple

import nbformat
import yaml
from docutils import nodes
from docutils.statemachine import StringList
from PIL import Image
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.docutils import SphinxDirective
from sphinx.writers.html5 import HTML5Translator

from numbers_extension import CHAPTER

#: Where the small pictures go, below the source, and their width in pixels: twice that of a screen without fine pixels.
FOLDER, WIDTH = "_static/gallery", 320
KINDS = {"live": "live, with a question", "interactive": "to play or to turn", "still": "still"}
_HEADING = re.compile(r"^#{1,4} (.+)$", re.MULTILINE)
_FENCED = re.compile(r"^(`{3,}|:{3,}).*?^\1", re.MULTILINE | re.DOTALL)
_PICTURE = re.compile(r'src="data:image/\w+;base64,([^"]+)"')
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
#: The first sentence, and the next where it is as short as "Two panels.".
_FIRST = re.compile(r".{25,}?[.?!](?= |$)")


class Shown(NamedTuple):
    """A figure of a chapter."""

    chapter: str  # name of the page
    cell: str  # id of the code cell
    kind: str
    label: str | None  # where it is numbered
    heading: str  # of the section
    words: str  # Markdown: its caption, its question, or what the picture shows
    text: str  # all that is said of it
    picture: bytes


def shown_figures(notebook: nbformat.NotebookNode, chapter: str) -> Iterator[Shown]:
    """The figures of a stored notebook in MyST, in reading order."""
    title = heading = ""
    for cell in notebook.cells:
        if cell.cell_type != "code":
            for found in _HEADING.findall(_FENCED.sub("", cell.source)):
                heading = re.sub(r" *\{.*\}$", "", found)
                title = title or heading
            continue
        if "solution" in cell.metadata.get("tags", []):
            continue
        about = cell.metadata.get("mystnb", {})
        caption = about.get("figure", {}).get("caption", "")
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            page = data.get("text/html", "")
            inside = _PICTURE.search(page) if "meshot-page" in page else None
            if "image/png" not in data and not inside:
                continue
            question = re.search(r"<legend><b>Predict first\.</b> (.*?)</legend>", page, re.DOTALL)
            alt = about.get("image", {}).get("alt") or unescape(re.search(r'aria-label="([^"]*)"', page)[1])
            asked = " ".join(unescape(question[1]).split()) if question else ""
            yield Shown(
                chapter,
                cell.id,
                "live" if question else "interactive" if inside else "still",
                about.get("figure", {}).get("name"),
                heading,
                " ".join((asked or caption or alt).split()),
                " ".join([title, heading, asked, caption, alt]),
                base64.b64decode(inside[1] if inside else data["image/png"]),
            )


def concepts_of(figures: list[Shown], concepts: dict[str, list[str]]) -> list[list[str]]:
    """The concepts of each figure: those of which one word begins somewhere in its text."""
    patterns = {name: re.compile(rf"(?<!\w)(?:{'|'.join(words)})") for name, words in concepts.items()}
    found = [[name for name, one in patterns.items() if one.search(figure.text.lower())] for figure in figures]
    for figure, names in zip(figures, found):
        if not names:
            raise ValueError(f"{figure.chapter}, {figure.cell}: its text has no word of concepts.yaml; add one")
    unused = sorted(concepts.keys() - {name for names in found for name in names})
    if unused:
        raise ValueError(f"no figure shows {', '.join(unused)}; mend concepts.yaml")
    return found


def thumbnail(picture: bytes) -> Image.Image:
    """A small picture on white."""
    with Image.open(io.BytesIO(picture)) as image:
        whole = image.convert("RGBA")
    ground = Image.new("RGBA", whole.size, "white")
    ground.alpha_composite(whole)
    small = ground.convert("RGB")
    small.thumbnail((WIDTH, WIDTH))
    return small


class gallery_item(nodes.General, nodes.Element):
    """One figure in the list."""


class Gallery(SphinxDirective):
    """All figures, with filters."""

    def run(self) -> list[nodes.Node]:
        """The filters, which a script brings to life, and the list."""
        source = Path(self.env.srcdir)
        concepts = yaml.safe_load((source / "concepts.yaml").read_text(encoding="utf-8"))
        chapters = sorted(file for file in source.glob("*.ipynb") if CHAPTER.fullmatch(file.stem))
        (source / FOLDER).mkdir(parents=True, exist_ok=True)
        figures = [one for file in chapters for one in shown_figures(nbformat.read(file, as_version=4), file.stem)]
        try:
            tags = concepts_of(figures, concepts)
        except ValueError as error:
            raise self.error(f"gallery: {error}") from error
        parts = [self._item(figure, names, f"{k}.webp") for k, (figure, names) in enumerate(zip(figures, tags))]
        kinds = [(kind, f"{words} ({sum(part['kind'] == kind for part in parts)})") for kind, words in KINDS.items()]
        numbers = [(number, number) for number in sorted({part["chapter"] for part in parts})]
        named = [(concept, concept) for concept in concepts]
        choices = [("chapter", "Chapter", numbers), ("concept", "Concept", named), ("kind", "Kind", kinds)]
        filters = "".join(_choice(*choice) for choice in choices)
        said = f'<p role="status" class="gallery-said">{len(parts)} figures</p>'
        head = f'<form class="gallery-filters" hidden>{filters}<button type="reset">all figures</button></form>{said}'
        return [_raw(head), _raw('<ul class="gallery">'), *parts, _raw("</ul>")]

    def _item(self, shown: Shown, tags: list[str], file: str) -> gallery_item:
        small = thumbnail(shown.picture)
        small.save(Path(self.env.srcdir) / FOLDER / file, "WEBP", quality=70)
        size = f'width="{small.width}" height="{small.height}"'
        item = gallery_item(chapter=shown.chapter[:2], kind=shown.kind, concepts="|".join(tags))
        item += _raw(f'<img src="{FOLDER}/{file}" {size} loading="lazy" alt="">')
        item += nodes.paragraph("", "", self._place(shown), classes=["gallery-place"])
        first = _FIRST.match(shown.words) if shown.kind != "live" else None
        item += self._words(first[0] if first else shown.words)
        cell = nodes.reference(
            "", "", nodes.Text(f"code ({shown.cell})"), internal=True,
            refuri=f"{shown.chapter}.html#{shown.cell}-code",
        )  # fmt: skip
        about = f"Chapter {shown.chapter[:2]}" + ("" if shown.kind == "still" else f" · {KINDS[shown.kind]}") + " · "
        item += nodes.paragraph("", "", nodes.Text(about), cell, classes=["gallery-cell"])
        return item

    def _place(self, shown: Shown) -> nodes.Node:
        if shown.label:
            return pending_xref(
                "", nodes.inline("", shown.label), refdoc=self.env.docname, refdomain="std", reftype="numref",
                reftarget=shown.label, refexplicit=False, refwarn=True,
            )  # fmt: skip
        heading = self._words(shown.heading).children
        return nodes.reference("", "", *heading, internal=True, refuri=f"{shown.chapter}.html#{shown.cell}")

    def _words(self, text: str) -> nodes.paragraph:
        """One paragraph of Markdown. Its links lead to places in the chapter, not here: their words stay."""
        holder = nodes.Element()
        plain = " ".join(_LINK.sub(r"\1", text).split())
        self.state.nested_parse(StringList([plain], source=self.env.docname), self.content_offset, holder)
        return nodes.paragraph("", "", *(child for paragraph in holder.children for child in paragraph.children))


class CellIds(SphinxTransform):
    """Code cells keep the ids of the notebook: ``cell-022`` for the cell, ``cell-022-code`` for its code."""

    default_priority = 200

    def apply(self, **kwargs: object) -> None:
        """Name the containers."""
        if not CHAPTER.fullmatch(self.env.docname):
            return
        for cell in self.document.findall(nodes.container):
            if cell.get("nb_element") == "cell_code":
                name = f"cell-{cell['cell_index']:03d}"
                cell["ids"].append(name)
                for part in cell:
                    if part.get("nb_element") == "cell_code_source":
                        part["ids"].append(f"{name}-code")


def visit_item(self: HTML5Translator, node: gallery_item) -> None:
    """Open an item of the list, with what the filters read."""
    about = {f"data-{key}": node[key] for key in ("chapter", "kind", "concepts")}
    self.body.append(self.starttag(node, "li", **about))


def depart_item(self: HTML5Translator, node: gallery_item) -> None:
    """Close it."""
    self.body.append("</li>\n")


def _choice(name: str, label: str, options: list[tuple[str, str]]) -> str:
    entries = "".join(f'<option value="{value}">{words}</option>' for value, words in [("", "all"), *options])
    return f'<label>{label} <select name="{name}">{entries}</select></label>'


def _raw(text: str) -> nodes.raw:
    return nodes.raw("", text, format="html")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive, its node, its files and the ids of cells."""
    app.add_directive("gallery", Gallery)
    app.add_node(gallery_item, html=(visit_item, depart_item))
    app.add_transform(CellIds)
    app.add_css_file("gallery.css")
    app.add_js_file("gallery.js")
    return {"parallel_read_safe": True, "parallel_write_safe": True}
