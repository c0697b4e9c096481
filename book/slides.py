"""Slides of every chapter, made from its rendered page: ``python book/slides.py [--html FOLDER]``.

A slide holds the objectives, the opening of a section with its formulas, a figure or table, a box, or a cell of code
that stays open. The other paragraphs become the notes of the speaker (press S). reveal.js comes from a Python package,
so that nothing needs a network.
"""

import argparse
import shutil
import sys
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import jinja2
from bs4 import Tag

from rendered import chapter_pages, lead_links, mathjax_settings, read_article

ROOT = Path(__file__).resolve().parent.parent
ASSETS = Path(__file__).parent / "assets"
REVEAL_FILES = ("dist/reset.css", "dist/reveal.css", "dist/reveal.js", "dist/theme/white.css", "plugin/notes/notes.js")
#: The last part of a chapter that is shown; it has one slide.
EXERCISES = "Exercises"
#: Sections, and words in the code of cells, that belong on a page and not on a wall.
QUESTIONS, UNSEEN = "Questions", ("provenance_lines", "environment_card")


class Slide(NamedTuple):
    """The section that a slide stands in, what it shows, and what is said with it."""

    section: str
    content: str
    notes: str


class Deck:
    """Slides, in the order in which a chapter is read."""

    def __init__(self) -> None:
        self.slides: list[list[str]] = []
        self.section = ""

    def show(self, content: str, section: str | None = None) -> None:
        """Begin a slide."""
        self.slides.append([self.section if section is None else section, content, ""])

    def add(self, content: str) -> None:
        """Put something on the last slide."""
        self.slides[-1][1] += content

    def say(self, words: str) -> None:
        """Put something in the notes of the last slide."""
        self.slides[-1][2] += words


def chapter_slides(article: Tag) -> list[Slide]:
    """The slides of a chapter."""
    top = article.section
    deck = Deck()
    deck.show(str(top.h1), "")
    for tag in top.find_all(recursive=False):
        if tag.name == "section":
            _add_section(deck, tag)
        elif tag.name == "ul" and len(deck.slides) == 1:
            deck.show(f"<h2>After this chapter you can</h2>{tag}", top.h1.get_text())
        elif tag.name != "h1":
            _add_part(deck, tag, False)
    return [Slide(*slide) for slide in deck.slides]


def _add_section(deck: Deck, section: Tag) -> None:
    heading = section.find(["h2", "h3"])
    if QUESTIONS in heading.get_text():
        return
    deck.section = heading.get_text()
    if EXERCISES in deck.section:
        names = [f"<li>{tag.get_text()}</li>" for tag in section.select("h3")]
        deck.show(f"{heading}<ul>{''.join(names)}</ul>", "")
        return
    deck.show(str(heading), "")
    opening = True
    for tag in section.find_all(recursive=False):
        if tag.name == "section":
            _add_section(deck, tag)
        elif tag is not heading:
            _add_part(deck, tag, opening)
            opening = opening and tag.name != "p"


def _add_part(deck: Deck, tag: Tag, opening: bool) -> None:
    """One piece of a section: on a slide of its own, on the slide of the opening, or in the notes."""
    classes = set(tag.get("class", []))
    if "cell" in classes:
        _add_cell(deck, tag)
    elif tag.name in ("figure", "table") or "proof" in classes or "admonition" in classes:
        deck.show(str(tag))
    elif "math" in classes or opening:
        deck.add(str(tag))
    else:
        deck.say(str(tag))


def _add_cell(deck: Deck, cell: Tag) -> None:
    """Code with what it prints on one slide; each figure and table on one of its own."""
    if any(word in cell.get_text() for word in UNSEEN):
        return
    code, output = cell.select_one(".cell_input"), cell.select_one(".cell_output")
    shows = output is not None and output.find(["figure", "img", "table"]) is not None
    if code:
        deck.show(f"{code}{output}" if output and not shows else str(code))
    if shows:
        deck.show(str(output))


def write_slides(page: Path, into: Path) -> Path:
    """Write the slides of a rendered chapter."""
    article = read_article(page)
    lead_links(article, lambda link: f"../{page.name}{link}" if link.startswith("#") else f"../{link}")
    for tag in article.select("[id]"):
        del tag["id"]
    template = jinja2.Template((ASSETS / "slides.html").read_text(encoding="utf-8"), trim_blocks=True)
    title = article.h1.get_text()
    text = template.render(title=title, slides=chapter_slides(article), settings=mathjax_settings(page))
    (into / page.name).write_text(text, encoding="utf-8")
    return into / page.name


def write_all(html: Path) -> Path:
    """Write the slides of all rendered chapters into ``html/slides``; the page that lists them.

    Raises
    ------
    ValueError
        If no chapter is rendered there.
    """
    pages = chapter_pages(html)
    into = html / "slides"
    shutil.rmtree(into, ignore_errors=True)
    reveal = Path(str(resources.files("sphinx_revealjs"))) / "_static" / "revealjs"
    for name in REVEAL_FILES:
        (into / "reveal" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(reveal / name, into / "reveal" / name)
    shutil.copytree(reveal / "dist" / "theme" / "fonts", into / "reveal" / "dist" / "theme" / "fonts")
    for name in ("slides.css", "slides.js"):
        shutil.copy(ASSETS / name, into)
    links = [f'<li><a href="{write_slides(page, into).name}">{page.stem}</a></li>' for page in pages]
    index = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Slides</title><ul>{"".join(links)}</ul></html>'
    )
    (into / "index.html").write_text(index, encoding="utf-8")
    return into / "index.html"


def main() -> int:
    """Write slides from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--html", type=Path, default=ROOT / "build" / "html", help="the rendered book")
    try:
        print(f"open {write_all(parser.parse_args().html.resolve())}")
    except ValueError as error:
        print(error)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
