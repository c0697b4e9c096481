"""A headless browser without a network, and what it finds wrong with a page."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlsplit

from playwright.sync_api import BrowserContext, Page, sync_playwright

FLAGS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]
LOCAL = ("file:", "data:", "blob:", "about:")

#: Text of the article that a reader sees as letters: not code, and not what MathJax has set.
VISIBLE_TEXT = """() => {
  const copy = (document.querySelector('article') || document.body).cloneNode(true);
  copy.querySelectorAll('pre, code, script, style, mjx-container, iframe').forEach(node => node.remove());
  return copy.textContent;
}"""
RAW_TEX = ("\\(", "\\[", "$$", "\\frac", "\\sum", "\\mathrm", "\\W", "\\SW", "\\theta", "_{", "^{")


@contextlib.contextmanager
def offline_browser(executable: str, width: int = 1280) -> Iterator[BrowserContext]:
    """A browser context that can open files and nothing else."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True)
        yield context
        browser.close()


def page_file(folder: Path, shown: object) -> Path:
    """A file in which something stands as a notebook would show it."""
    path = folder / "page.html"
    path.write_text(f"<!doctype html><meta charset=utf-8><body>{shown._repr_html_()}</body>", encoding="utf-8")
    return path


@contextlib.contextmanager
def watched_page(context: BrowserContext, file: Path) -> Iterator[tuple[Page, list[str]]]:
    """An open page, loaded and typeset, and the list of troubles that grows while it is used."""
    troubles: list[str] = []
    page = context.new_page()
    page.on("request", lambda r: None if r.url.startswith(LOCAL) else troubles.append(f"request leaves: {r.url}"))
    page.on("requestfailed", lambda r: troubles.append(f"request failed: {r.url}"))
    page.on("console", lambda m: troubles.append(f"console: {m.text}") if m.type == "error" else None)
    page.on("pageerror", lambda error: troubles.append(f"script error: {error}"))
    page.goto(file.as_uri(), wait_until="load")
    page.evaluate("() => window.MathJax && MathJax.startup ? MathJax.startup.promise.then(() => null) : null")
    yield page, troubles
    page.close()


def raw_tex(page: Page) -> list[str]:
    """Formulas that were not set, and those that MathJax could not read."""
    text = page.evaluate(VISIBLE_TEXT)
    found = [
        f"raw TeX {mark!r}: …{text[max(0, text.find(mark) - 30) : text.find(mark) + 30]}…"
        for mark in RAW_TEX
        if mark in text
    ]
    return found + [
        f"MathJax error: {m}" for m in page.eval_on_selector_all("mjx-merror", "e => e.map(x => x.textContent)")
    ]


def broken_links(page: Page, file: Path) -> list[str]:
    """Links and pictures of a page that lead to no file, or to no place within one."""
    troubles = []
    references = page.eval_on_selector_all(
        "a[href], img[src]", "e => e.map(x => x.getAttribute('href') || x.getAttribute('src'))"
    )
    for reference in sorted(set(references)):
        parts = urlsplit(reference)
        if parts.scheme:
            continue
        other = (file.parent / unquote(parts.path)).resolve() if parts.path else file
        if not other.is_file():
            troubles.append(f"broken link: {reference}")
        elif (
            parts.fragment
            and other.suffix == ".html"
            and f'id="{unquote(parts.fragment)}"' not in other.read_text("utf-8")
        ):
            troubles.append(f"link to no place: {reference}")
    return troubles


def troubles_of(context: BrowserContext, file: Path) -> list[str]:
    """Everything that is wrong with one page."""
    with watched_page(context, file) as (page, troubles):
        return troubles + raw_tex(page) + broken_links(page, file)
