"""A headless browser without a network, and what it finds wrong with a page."""

import contextlib
import functools
import gzip
import re
from collections.abc import Iterator
from importlib import resources
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
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
]
LOCAL = ("file:", "data:", "blob:", "about:")

#: Text of the article that a reader sees as letters: not code, and not what MathJax has set.
VISIBLE_TEXT = """() => {
  const copy = (document.querySelector('article') || document.body).cloneNode(true);
  copy.querySelectorAll('pre, code, script, style, mjx-container, iframe').forEach(node => node.remove());
  return copy.textContent;
}"""
RAW_TEX = ("\\(", "\\[", "$$", "\\frac", "\\sum", "\\mathrm", "\\W", "\\SW", "\\theta", "_{", "^{")

#: The widths, in pixels, at which a page is read: a desk, a tablet, a telephone.
WIDTHS = (1280, 800, 400)

#: Elements of the content that scroll sideways, are clipped, or stick out of the column: the outermost of each.
#: A formula counts as one element. What is hidden from the eye on purpose does not count.
SIDEWAYS = """() => {
  const root = document.querySelector('article') || document.querySelector('main') || document.body;
  const end = Math.min(document.documentElement.clientWidth, root.getBoundingClientRect().right) + 1;
  const found = [];
  const done = new Set();
  for (const node of root.querySelectorAll('*:not(mjx-container *):not(svg *)')) {
    const style = getComputedStyle(node);
    const box = node.getBoundingClientRect();
    const unseen = !node.checkVisibility({ visibilityProperty: true }) || box.width <= 1 || box.height <= 1;
    if (done.has(node.parentElement) || unseen || style.clipPath !== 'none') {
      done.add(node);
      continue;
    }
    const formula = node.localName === 'mjx-container' || node.classList.contains('math');
    const within = formula || style.display === 'inline' ? 0 : node.scrollWidth - node.clientWidth;
    const held = style.overflowX !== 'visible' && within > 1;
    if (held || box.right > end || box.left < -1) {
      done.add(node);
      const what = held ? `${within} px hidden` : `from ${Math.round(box.left)} to ${Math.round(box.right)}`;
      found.push(`${node.localName}.${node.className}: ${what}: ${node.textContent.trim().slice(0, 40)}`);
    }
  }
  const page = document.documentElement;
  return page.scrollWidth > page.clientWidth ? [...found, `the page is ${page.scrollWidth} px wide`] : found;
}"""
#: Of what stands on a page many times, some are looked at: more of a kind would show the same again, in minutes.
SAMPLE = """() => {
  const most = [
    ['.highlight', 5], ['mjx-container', 8], ['table', 8], ['section > dl.py', 8], ['article figure', 12],
    ['.quiz-question', 2], ['.claim', 8], ['.bd-sidebar-primary li', 12], ['dl.glossary > *', 24],
  ];
  for (const [kind, count] of most) [...document.querySelectorAll(kind)].slice(count).forEach((node) => node.remove());
  document.querySelectorAll('table')
    .forEach((table) => [...table.querySelectorAll('tbody tr')].slice(5).forEach((row) => row.remove()));
  document.querySelectorAll('.highlight').forEach((code) => [...code.querySelectorAll('pre > span')].slice(40)
    .forEach((word) => word.remove()));
  document.querySelectorAll('article details').forEach((folded) => (folded.open = true));
}"""
#: Of axe-core; the light page is held to all of its rules, the dark one to those of colour. Contrast, which takes long,
#: is measured on three pieces of text for each look: colour, size, weight, and the grounds behind.
AXE = """async (everything) => {
  const looks = new Map();
  const groundsOf = (node) => {
    const { backgroundColor, backgroundImage, opacity } = getComputedStyle(node);
    return `${backgroundColor} ${backgroundImage} ${opacity};${node.parentElement ? groundsOf(node.parentElement) : ''}`
      .replaceAll('rgba(0, 0, 0, 0) none 1;', '');
  };
  for (const node of document.body.querySelectorAll('*')) {
    if (![...node.childNodes].some((part) => part.nodeType === Node.TEXT_NODE && part.data.trim())) continue;
    const { color, fontSize, fontWeight } = getComputedStyle(node);
    const look = `${color} ${fontSize} ${fontWeight} ${groundsOf(node)}`;
    const alike = looks.get(look) ?? [];
    if (alike.length < 3 && node.checkVisibility({ visibilityProperty: true })) looks.set(look, [...alike, node]);
  }
  const texts = [...looks.values()].flat();
  const run = (where, options) => axe.run(where, { ...options, resultTypes: ['violations'] });
  const found = [await run(texts.length ? texts : document, { runOnly: ['color-contrast', 'link-in-text-block'] })];
  if (everything) found.push(await run(document, { rules: { 'color-contrast': { enabled: false } } }));
  return found.flatMap(({ violations }) => violations)
    .filter((violation) => ['serious', 'critical'].includes(violation.impact))
    .map((v) => `${v.id} (${v.nodes.length}): ${v.nodes[0].target} ${v.nodes[0].any[0]?.message ?? v.help}`);
}"""
#: What fades, from one theme to the other or because it was unfolded, has arrived before it is measured. An animation
#: without an end cannot be finished.
SET_THEME = """(theme) => {
  document.documentElement.dataset.theme = theme;
  const ends = (each) => each.effect.getComputedTiming().endTime < Infinity;
  document.getAnimations().filter(ends).forEach((each) => each.finish());
}"""
#: Controls that a mouse can use and a keyboard cannot reach.
UNREACHED = """() => {
  const controls = 'a[href], button, input, select, textarea, summary, canvas[tabindex], [role=button], [onclick]';
  return [...document.querySelectorAll(controls)]
    .filter((node) => node.checkVisibility({ visibilityProperty: true }) && !node.disabled && node.type !== 'hidden')
    .filter((node) => node.tabIndex < 0 || (node.focus({ preventScroll: true }), document.activeElement !== node))
    .map((node) => node.outerHTML.slice(0, 120));
}"""
#: What still loads when a page is left, or loaded again. A file that is not there fails with another message.
ABORTED = "net::ERR_ABORTED"
#: Sent by a server in packed form.
PACKED = (".html", ".css", ".js", ".json", ".svg")


@contextlib.contextmanager
def offline_browser(executable: str, width: int = 1280, **options: object) -> Iterator[BrowserContext]:
    """A browser context that can open files and nothing else."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True, **options)
        yield context
        browser.close()


def page_file(folder: Path, shown: object) -> Path:
    """A file in which something stands as a notebook would show it."""
    path = folder / "page.html"
    path.write_text(f"<!doctype html><meta charset=utf-8><body>{shown._repr_html_()}</body>", encoding="utf-8")
    return path


@contextlib.contextmanager
def watched_page(
    context: BrowserContext, file: Path, loaded: set[Path] | None = None
) -> Iterator[tuple[Page, list[str]]]:
    """An open page, loaded and typeset, and the list of troubles that grows while it is used.

    Files that the page loads are added to ``loaded``.
    """
    troubles: list[str] = []
    page = context.new_page()
    if loaded is not None:
        page.on("requestfinished", lambda request: loaded.add(Path(unquote(urlsplit(request.url).path))))
    page.on("request", lambda r: None if r.url.startswith(LOCAL) else troubles.append(f"request leaves: {r.url}"))
    page.on("requestfailed", lambda r: None if r.failure == ABORTED else troubles.append(f"request failed: {r.url}"))
    page.on("console", lambda m: troubles.append(f"console: {m.text}") if m.type == "error" else None)
    page.on("pageerror", lambda error: troubles.append(f"script error: {error}"))
    page.goto(file.as_uri(), wait_until="load")
    page.evaluate("() => window.MathJax && MathJax.startup ? MathJax.startup.promise.then(() => null) : null")
    yield page, troubles
    page.close()


def set_width(page: Page, width: int) -> None:
    """Make the window as wide as that, and wait until the scripts of the page have fitted what it holds."""
    page.set_viewport_size({"width": width, "height": 900})
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def sideways(page: Page) -> list[str]:
    """What scrolls sideways or is clipped, at each width at which the book is read."""
    found = []
    for width in WIDTHS:
        set_width(page, width)
        found += [f"at {width} px: {trouble}" for trouble in page.evaluate(SIDEWAYS)]
    return found


def barriers(page: Page) -> list[str]:
    """Serious and critical violations that axe-core finds, light and dark, and controls out of the keyboard's reach."""
    source = resources.files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    page.evaluate(source)
    page.evaluate("() => document.querySelectorAll('article details').forEach((folded) => (folded.open = true))")
    found = [f"keyboard: {control}" for control in page.evaluate(UNREACHED)]
    page.evaluate(SAMPLE)
    for theme in ("light", "dark"):
        page.evaluate(SET_THEME, theme)
        found += [f"{theme}: {violation}" for violation in page.evaluate(AXE, theme == "light")]
    return found


def weight(files: set[Path]) -> int:
    """Bytes that a server sends for files: text packed, as every server does, and the rest as it is."""
    return sum(_sent(file, file.stat().st_size, file.stat().st_mtime_ns) for file in files)


@functools.cache
def _sent(file: Path, size: int, changed: int) -> int:
    """Bytes of one file; many pages load the same scripts."""
    return len(gzip.compress(file.read_bytes(), 6)) if file.suffix in PACKED else size


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
            and unquote(parts.fragment) not in _ids(other, other.stat().st_mtime_ns)
        ):
            troubles.append(f"link to no place: {reference}")
    return troubles


@functools.cache
def _ids(file: Path, changed: int) -> frozenset[str]:
    """The ids of a page; many links lead to the same page."""
    return frozenset(re.findall(r'id="([^"]*)"', file.read_text("utf-8")))


def troubles_of(context: BrowserContext, file: Path) -> list[str]:
    """Everything that is wrong with one page."""
    with watched_page(context, file) as (page, troubles):
        return troubles + raw_tex(page) + broken_links(page, file)
