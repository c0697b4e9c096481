"""Slides of every chapter, made from its rendered page: ``python book/slides.py [--html FOLDER]``.

A slide holds the objectives, the opening of a section with its formulas, a figure or table, a box, or a cell of code
that stays open. The other paragraphs become the notes of the speaker (press S). The arrow to the right leads through a
set of slides for thirty minutes; the others are below them (the arrow down). Interactive figures work on their slides:
each is a page of its own in a frame, loaded when its slide is shown. reveal.js comes from a Python package, so that
nothing needs a network.
"""

import argparse
import re
import shutil
import sys
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import jinja2
from bs4 import BeautifulSoup, Tag

from rendered import chapter_pages, lead_links, mathjax_settings, read_article

ROOT = Path(__file__).resolve().parent.parent
ASSETS = Path(__file__).parent / "assets"
REVEAL_FILES = ("dist/reset.css", "dist/reveal.css", "dist/reveal.js", "dist/theme/white.css", "plugin/notes/notes.js")
#: The last part of a chapter that is shown; it has one slide.
EXERCISES = "Exercises"
#: Sections, and words in the code of cells, that belong on a page and not on a wall.
QUESTIONS, UNSEEN = "Questions", ("provenance_lines", "environment_card")


#: In thirty minutes, with a minute and a half for each.
MOST_CHOSEN = 20
#: What a slide shows, told from its content: the first of these is preferred for the chosen set.
KINDS = (
    ("figure", re.compile("<img|<iframe")),
    ("box", re.compile('^<div class="[^"]*proof')),
    ("opening", re.compile("^<h")),
)


class Slide(NamedTuple):
    """The section that a slide stands in, what it shows, and what is said with it."""

    section: str
    content: str
    notes: str

    @property
    def kind(self) -> str:
        """A figure, a box, the opening of a section, or a detail."""
        return next((name for name, pattern in KINDS if pattern.search(self.content)), "detail")


def chapter_slides(article: Tag) -> list[Slide]:
    """The slides of a chapter, in the order in which it is read."""
    top, slides, title = article.section, [], ""

    def show(content: str, section: str | None = None) -> None:
        """Begin a slide."""
        slides.append(Slide(title if section is None else section, content, ""))

    def add_section(section: Tag) -> None:
        nonlocal title
        heading = section.find(["h2", "h3"])
        if QUESTIONS in heading.get_text():
            return
        title = heading.get_text()
        if EXERCISES in title:
            names = [f"<li>{tag.get_text()}</li>" for tag in section.select("h3")]
            show(f"{heading}<ul>{''.join(names)}</ul>", "")
            return
        show(str(heading), "")
        opening = True
        for tag in section.find_all(recursive=False):
            if tag.name == "section":
                add_section(tag)
            elif tag is not heading:
                add_part(tag, opening)
                opening = opening and tag.name != "p"

    def add_part(tag: Tag, opening: bool) -> None:
        """One piece of a section: on a slide of its own, on the slide of the opening, or in the notes."""
        classes = set(tag.get("class", []))
        if "cell" in classes:
            # Code with what it prints on one slide; each figure and table on one of its own.
            if any(word in tag.get_text() for word in UNSEEN):
                return
            code, output = tag.select_one(".cell_input"), tag.select_one(".cell_output")
            shows = output is not None and output.find(["figure", "iframe", "img", "table"]) is not None
            if code:
                show(f"{code}{output}" if output and not shows else str(code))
            if shows:
                show(str(output))
        elif tag.name in ("figure", "table") or "proof" in classes or "admonition" in classes:
            show(str(tag))
        elif "math" in classes or opening:
            slides[-1] = slides[-1]._replace(content=f"{slides[-1].content}{tag}")
        else:
            slides[-1] = slides[-1]._replace(notes=f"{slides[-1].notes}{tag}")

    show(str(top.h1), "")
    for tag in top.find_all(recursive=False):
        if tag.name == "section":
            add_section(tag)
        elif tag.name == "ul" and len(slides) == 1:
            show(f"<h2>After this chapter you can</h2>{tag}", top.h1.get_text())
        elif tag.name != "h1":
            add_part(tag, False)
    return slides


def stacks(slides: list[Slide]) -> list[list[Slide]]:
    """Slides in columns: the first of each is chosen, the others are more on it.

    Chosen are the title, the objectives, the exercises, one slide of every section that shows it best, and further
    figures and boxes while there is room.
    """
    chosen = {0, 1, len(slides) - 1}
    sections: list[list[int]] = []  # each begins with its opening
    for number, slide in enumerate(slides[2:-1], 2):
        if slide.content.startswith("<h2") or not sections:
            sections.append([])
        sections[-1].append(number)
    ranks = [name for name, _ in KINDS] + ["detail"]
    best = [min(section, key=lambda number: ranks.index(slides[number].kind)) for section in sections]
    others = sorted((number for number in range(len(slides))), key=lambda number: ranks.index(slides[number].kind))
    for number in [*best, *(number for number in others if slides[number].kind in ("figure", "box"))]:
        if len(chosen) < MOST_CHOSEN:
            chosen.add(number)
    columns: list[list[Slide]] = []
    for number, slide in enumerate(slides):
        if number in chosen:
            columns.append([])
        columns[-1].append(slide)
    return columns


def write_all(html: Path) -> Path:
    """Write the slides of all rendered chapters into ``html/slides``; the page that lists them."""
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
    (into / "live").mkdir()
    template, frame = (
        jinja2.Template((ASSETS / name).read_text(encoding="utf-8"), trim_blocks=True)
        for name in ("slides.html", "live_figure.html")
    )
    for page in pages:
        article = read_article(page)
        whole = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")
        for tag in article.select(".meshot-page[id]"):
            name, title = tag["id"], tag["aria-label"]
            figure = whole.find(id=name)
            text = frame.render(title=title, figure=str(figure), script=str(figure.find_next_sibling("script")))
            (into / "live" / f"{name}.html").write_text(text, encoding="utf-8")
            attributes = {"class": "live", "data-src": f"live/{name}.html", "title": title}
            tag.replace_with(whole.new_tag("iframe", attrs=attributes))
        lead_links(article, lambda link, name=page.name: f"../{name}{link}" if link.startswith("#") else f"../{link}")
        for tag in article.select("figure[id] .caption-number"):
            there = f"../{page.name}#{tag.find_parent('figure')['id']}"  # where panels are live
            tag.wrap(BeautifulSoup("", "html.parser").new_tag("a", href=there, target="_blank"))
        for tag in article.select("[id]"):
            del tag["id"]
        title, columns = article.h1.get_text(), stacks(chapter_slides(article))
        text = template.render(title=title, columns=columns, settings=mathjax_settings(page))
        (into / page.name).write_text(text, encoding="utf-8")
    links = [f'<li><a href="{page.name}">{page.stem}</a></li>' for page in pages]
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
