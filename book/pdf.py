"""The whole book as a PDF, printed by a headless browser from the rendered pages: ``python book/pdf.py``.

The pages are joined in one document, with links that lead within it, page numbers and an outline. The entries of the
API are left out.
"""

import argparse
import sys
from pathlib import Path

import jinja2
from playwright.sync_api import sync_playwright

from rendered import chapter_pages, lead_links, mathjax_settings, read_article

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))
from preflight import browser, missing_browser  # noqa: E402

ASSETS = Path(__file__).parent / "assets"
FRONT = ("getting_started",)
BACK = ("howto", "commands", "ledger", "limits", "notation", "glossary", "teaching", "speed", "references")
FOOT = """<div style="font-size: 7pt; width: 100%; text-align: center"><span class="pageNumber"></span></div>"""


def joined_link(link: str, name: str, names: set[str]) -> str:
    """Where a link of the page ``name`` leads in the joined document; pages that are not in it stay files."""
    page, _, anchor = link.partition("#")
    target = Path(page).stem if page else name
    if target not in names or (page and Path(page).suffix != ".html") or "/" in page:
        return link
    return f"#{target}--{anchor}" if anchor else f"#{target}"


def write_document(html: Path) -> Path:
    """Join the pages in ``html/print.html``."""
    chapters = chapter_pages(html)
    pages = [*(html / f"{name}.html" for name in FRONT), *chapters, *(html / f"{name}.html" for name in BACK)]
    pages = [page for page in pages if page.is_file()]
    names = {page.stem for page in pages}
    parts = []
    for page in pages:
        article = read_article(page)
        # Ids of its own, which links within the document lead to.
        for tag in article.select("[id]"):
            tag["id"] = f"{page.stem}--{tag['id']}"
        lead_links(article, lambda link, name=page.stem: joined_link(link, name, names))
        title, content = article.find("h1").get_text(), article.decode_contents()
        parts.append({"name": page.stem, "title": title, "html": content})
    template = jinja2.Template((ASSETS / "print.html").read_text(encoding="utf-8"))
    text = template.render(
        title="Meshes as Measures",
        style=(ASSETS / "print.css").read_text(encoding="utf-8"),
        settings=mathjax_settings(chapters[0]),
        parts=parts,
    )
    (html / "print.html").write_text(text, encoding="utf-8")
    return html / "print.html"


def main() -> int:
    """Print the book from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--html", type=Path, default=ROOT / "build" / "html", help="the rendered book")
    html = parser.parse_args().html.resolve()
    try:
        if missing_browser():
            raise ValueError(missing_browser())
        document = write_document(html)
    except ValueError as error:
        print(error)
        return 1
    pdf = html.parent / "meshes_as_measures.pdf"
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser(), args=["--no-sandbox"])
        page = opened.new_context(offline=True).new_page()
        page.goto(document.as_uri(), wait_until="load", timeout=300_000)
        page.evaluate("() => window.MathJax && MathJax.startup.promise.then(() => null)")
        margin = {"top": "18mm", "bottom": "18mm", "left": "20mm", "right": "20mm"}
        page.pdf(
            path=pdf, format="A4", margin=margin, outline=True, tagged=True, print_background=True,
            display_header_footer=True, header_template="<span></span>", footer_template=FOOT,
        )  # fmt: skip
        opened.close()
    document.unlink()
    print(f"open {pdf}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
