"""Put the book's source together and render it with Sphinx.

``stored``  from the outputs of the notebooks beside the chapters, which nbval verifies (``make html``)
``fresh``   from the runs in ``build/notebooks`` (``make book``)
"""

import argparse
import importlib.metadata
import multiprocessing
import re
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import nbformat
import yaml
from PIL import Image
from sphinx.application import Sphinx
from sphinx.errors import SphinxError
from sphinx.util.docutils import docutils_namespace, patch_docutils

from meshot.files import scratch_folder, whole_folder
from meshot.workers import begin_worker
from run_notebooks import retold_notebook

ROOT = Path(__file__).resolve().parent.parent
CONFIGURATION = ("conf.py", "api_pages.py", "*_extension.py")
#: Two thirds of a megabyte that draw icons, which the theme's font draws too.
ICONS = re.compile(r"<script[^>]*/fontawesome\.js[^>]*></script>")
SIGNATURE = re.compile(r'<dt class="sig .*?</dt>', re.S)
MATHJAX = "static/mathjax/"
#: Pictures above this size, in bytes, are stored anew; quality is that of WebP, of 100.
LARGE, QUALITY = 30_000, 82
#: Addresses of pages that were renamed: old name -> new name.
MOVED = ROOT / "book" / "moved.yaml"
#: A page that leads on to another, with the place in it, for readers and for programs.
LEADS_ON = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>This page has moved</title>
<meta http-equiv="refresh" content="1; url={new}.html"><link rel="canonical" href="{new}.html">
<script>location.replace("{new}.html" + location.hash);</script></head>
<body><main><h1>This page has moved</h1><p>It is now <a href="{new}.html">here</a>.</p></main></body></html>
"""
MATHJAX_FILES = ("tex-chtml.js", "output/chtml/fonts/woff-v2/")


def assemble(notebooks: Path, source: Path) -> None:
    """Collect pages, chapters with the outputs of their notebooks, and MathJax in one folder for Sphinx."""
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(
        ROOT / "book", source, ignore=shutil.ignore_patterns("__pycache__", "*.py", "assets", "claims.yaml", MOVED.name)
    )
    copy_configuration(source)
    for text in sorted((ROOT / "notebooks").glob("[0-9]*.md")):
        notebook = notebooks / f"{text.stem}.ipynb"
        if not notebook.is_file():
            raise ValueError(f"{notebook} does not exist; run the notebooks first: make notebooks")
        nbformat.write(retold_notebook(text, notebooks), source / notebook.name)
    copy_mathjax(source / "_static" / "mathjax")


def copy_configuration(into: Path) -> None:
    """Copy Sphinx's configuration and the extensions that are the book's own."""
    for pattern in CONFIGURATION:
        for module in sorted((ROOT / "book").glob(pattern)):
            shutil.copy(module, into)


def copy_mathjax(into: Path) -> None:
    """Copy the one MathJax file that is needed, and its fonts, out of the Python package that carries all of it."""
    for file in importlib.metadata.files("sphinx-mathjax-offline"):
        _, found, inside = file.as_posix().partition(MATHJAX)
        if found and inside.startswith(MATHJAX_FILES):
            (into / inside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file.locate(), into / inside)
    if not (into / MATHJAX_FILES[0]).is_file():
        raise ValueError("sphinx-mathjax-offline holds no tex-chtml.js; install the locked version")


def render(source: Path, html: Path) -> int:
    """Run Sphinx in a process that ends with this one, every warning an error; the exit status."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=begin_worker) as pool:
        return pool.submit(_run_sphinx, source, html).result()


def _run_sphinx(source: Path, html: Path) -> int:
    """Run Sphinx in this process; the exit status. Its own files go beside the source."""
    try:
        with patch_docutils(source), docutils_namespace():
            sphinx = Sphinx(
                source, source, html, source.parent / "doctrees", "html",
                confoverrides={"nitpicky": True}, status=None, warningiserror=True,
            )  # fmt: skip
            sphinx.build()
            return sphinx.statuscode
    except SphinxError as error:
        if isinstance(error.__cause__, OSError):
            raise error.__cause__ from error
        print(f"{error.category}: {error}", file=sys.stderr)
        return 2


def lighten(html: Path) -> None:
    """Store large PNG pictures of the pages as WebP, a fifth of the size, and lead the pages to them."""
    pages = {page: page.read_text(encoding="utf-8") for page in html.glob("*.html")}
    for picture in sorted((html / "_images").glob("*.png")):
        if picture.stat().st_size > LARGE:
            with Image.open(picture) as image:
                image.convert("RGBA" if "A" in image.getbands() else "RGB").save(
                    picture.with_suffix(".webp"), quality=QUALITY
                )
            picture.unlink()
            for page, text in pages.items():
                pages[page] = text.replace(f"_images/{picture.name}", f"_images/{picture.stem}.webp")
    for page, text in pages.items():
        page.write_text(text, encoding="utf-8")


def mend_pages(html: Path) -> None:
    """Leave icons to the theme's font, and make plain blocks of what claims to be a list and has no items or terms."""
    blocks = {"<dl>": '<div class="sig-parameters">', "</dl>": "</div>", "<dd>": "<div>", "</dd>": "</div>"}
    for page in html.rglob("*.html"):
        text = ICONS.sub("", page.read_text(encoding="utf-8"))
        text = text.replace('<div role="list" class="citation-list">', '<div class="citation-list">')
        # Long signatures of the API come as lists of definitions.
        text = SIGNATURE.sub(lambda found: re.sub("</?d[ld]>", lambda tag: blocks[tag[0]], found[0]), text)
        page.write_text(text, encoding="utf-8")
    for script in html.glob("_static/scripts/fontawesome.js*"):
        script.unlink()


def redirect_moved_pages(html: Path) -> None:
    """Let the addresses of before lead to those pages of now that the book has."""
    for old, new in yaml.safe_load(MOVED.read_text(encoding="utf-8")).items():
        if (html / f"{new}.html").is_file():
            (html / f"{old}.html").write_text(LEADS_ON.format(new=new), encoding="utf-8")


def build(mode: str, into: Path) -> int:
    """Assemble and render the book into ``into/html``; the exit status.

    The book that is there gives way to the new one when that is whole, and stays if anything fails.
    """
    notebooks = ROOT / "notebooks" if mode == "stored" else ROOT / "build" / "notebooks"
    into.mkdir(parents=True, exist_ok=True)
    try:
        with scratch_folder(into) as place, whole_folder(into / "html", replace=True) as html:
            assemble(notebooks, place / "source")
            status = render(place / "source", html)
            if status:
                raise ValueError(f"the book was not rendered: Sphinx ended with status {status}")
            for chapter in html.glob("_sources/[0-9]*.ipynb"):  # what readers download
                shutil.copy(notebooks / chapter.name, chapter)
            lighten(html)
            mend_pages(html)
            redirect_moved_pages(html)
    except (ValueError, OSError) as error:
        print(error)
        return 1
    print(f"open {into / 'html' / 'index.html'}")
    return 0


def main() -> int:
    """Build from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mode", choices=("stored", "fresh"))
    parser.add_argument("--into", type=Path, default=ROOT / "build")
    options = parser.parse_args()
    return build(options.mode, options.into.resolve())


if __name__ == "__main__":
    sys.exit(main())
