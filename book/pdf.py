"""The whole book as a PDF, printed by a headless browser from the rendered pages: ``python book/pdf.py``.

The pages are joined in one document, with links that lead within it, page numbers and an outline. The entries of the
API are left out.
"""

import argparse
import io
import sys
import zlib
from pathlib import Path

import jinja2
import pikepdf
from PIL import Image
from playwright.sync_api import sync_playwright

from meshot.files import whole_file
from rendered import chapter_pages, lead_links, mathjax_settings, read_article

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))
from preflight import browser, missing_browser  # noqa: E402

ASSETS = Path(__file__).parent / "assets"
FRONT = ("getting_started",)
BACK = (
    "howto",
    "freesurfer",
    "commands",
    "ledger",
    "limits",
    "notation",
    "glossary",
    "teaching",
    "speed",
    "references",
)
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


def lighten(path: Path) -> None:
    """Write a PDF of the browser anew, with smaller pictures and its objects compressed.

    The browser stores each picture with three bytes a pixel. Pictures of at most 256 colours get a palette, which
    changes no pixel. The others become JPEG of quality 85, or get a palette of 256 colours, whichever is smaller.
    """
    with whole_file(path) as temporary, pikepdf.open(path) as pdf:
        for stream in pdf.objects:
            if not isinstance(stream, pikepdf.Stream) or stream.get("/Subtype") != "/Image":
                continue
            if stream.get("/Filter") != "/FlateDecode" or stream.get("/BitsPerComponent") != 8:
                continue
            size, before = (int(stream.Width), int(stream.Height)), stream.read_bytes()
            if len(before) != 3 * size[0] * size[1]:
                continue  # grey: the transparency of another picture
            picture = Image.frombytes("RGB", size, before)
            colours = picture.getcolors(256)
            if colours:
                palette = picture.convert("P", palette=Image.Palette.ADAPTIVE, colors=len(colours))
            else:
                palette = picture.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
            data, jpeg = zlib.compress(palette.tobytes(), 9), io.BytesIO()
            if colours is None:
                picture.save(jpeg, "JPEG", quality=85, subsampling=0, optimize=True)
            if 0 < jpeg.tell() < len(data):
                stream.write(jpeg.getvalue(), filter=pikepdf.Name.DCTDecode)
                stream.ColorSpace = pikepdf.Name.DeviceRGB
            elif len(data) < len(stream.read_raw_bytes()):
                stream.write(data, filter=pikepdf.Name.FlateDecode)
                entries = bytes(palette.getpalette())
                stream.ColorSpace = pikepdf.Array(
                    [pikepdf.Name.Indexed, pikepdf.Name.DeviceRGB, len(entries) // 3 - 1, pikepdf.String(entries)]
                )
        pdf.save(temporary, object_stream_mode=pikepdf.ObjectStreamMode.generate, recompress_flate=True)


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
    lighten(pdf)
    print(f"open {pdf}, {pdf.stat().st_size / 1e6:.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
