"""Chapters as they were rendered, without what only a browser needs: for slides and for the printed book."""

import re
from collections.abc import Callable
from pathlib import Path

from bs4 import BeautifulSoup, Tag

#: What has no place on a slide or on paper: anchors, scripts, controls, quizzes, folded cells and hints.
LEFT_OUT = (
    "a.headerlink, script, style, .controls, .panels, .parts, fieldset, .quiz, details, [hidden], .hint, .help, "
    "input, select, .toggle-button, .visually-hidden"
)


def read_article(page: Path) -> Tag:
    """The article of a page, reduced to words, formulas, pictures, tables and the code that stays open."""
    article = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser").select_one("article")
    for button in article.select("button:has(img)"):
        button.replace_with(button.find("img"))
    for tag in article.select(LEFT_OUT + ", button"):
        tag.decompose()
    for cell in article.select("div.cell"):
        if not cell.get_text(strip=True) and not cell.find("img"):
            cell.decompose()
    return article


def mathjax_settings(page: Path) -> str:
    """The settings of MathJax that a page of the book carries."""
    text = page.read_text(encoding="utf-8")
    found = re.search(r"<script>window\.MathJax = .*?</script>", text, re.S)
    return found[0] if found else ""


def lead_links(root: Tag, lead: Callable[[str], str]) -> None:
    """Change where local links and pictures lead."""
    for name in ("href", "src"):
        for tag in root.select(f"[{name}]"):
            if not re.match(r"[a-z]+:", tag[name]):
                tag[name] = lead(tag[name])


def chapter_pages(html: Path) -> list[Path]:
    """The chapters of a rendered book, in order."""
    found = sorted(html.glob("[0-9][0-9]_*.html"))
    pages = [page for page in found if "<title>This page has moved" not in page.read_text(encoding="utf-8")]
    if not pages:
        raise ValueError(f"{html} holds no rendered chapter; render the book first: make html")
    return pages
