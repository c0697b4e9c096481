"""Time until a live figure is painted in the browser: ``python benchmarks/live_paint.py``.

Two times of every live figure, each the median of 20 pages. *opened*: from the first byte of the body until the page
with still and question is painted. *begun*: from the reader's answer until the plots are painted. A page counts as
painted in the second frame after the work. Pages of a figure are opened one right after another, so that what the
browser still has to paint of one counts for the next. The goal is 100 ms on a desk. A busy machine needs more, so this
is no test.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parent.parent
sys.path += [str(ROOT / folder) for folder in ("tests", "tests/live", "tools")]

from live_frame import processor  # noqa: E402
from live_pages import DATA, live_page_of  # noqa: E402

from browser import offline_browser, page_file  # noqa: E402
from preflight import browser  # noqa: E402

PAINTED = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now()))))"


def main() -> int:
    """Time the figures from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pages", type=int, default=20)
    given = parser.parse_args()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder, offline_browser(browser()) as context:
        page = context.new_page()
        for name in DATA:
            shown = live_page_of(name)
            file = page_file(Path(folder), shown)
            text = file.read_text("utf-8")
            watch = f"<script>window.began = performance.now(); window.painted = {PAINTED};</script>"
            file.write_text(text.replace("<body>", f"<body>{watch}", 1), encoding="utf-8")
            opened, begun = [], []
            for _ in range(given.pages):
                page.goto(file.as_uri())
                opened.append(page.evaluate("async () => (await window.painted) - window.began"))
                start = "const start = performance.now(); document.querySelector('.show').click();"
                begun.append(page.evaluate(f"async () => {{ {start} return (await {PAINTED}) - start; }}"))
            slowest = max(slowest, median(opened), median(begun))
            both = [f"{median(times):.0f} ms (fastest {min(times):.0f})" for times in (opened, begun)]
            print(f"{name}: opened {both[0]}, begun {both[1]}")
    print(f"the slowest: {slowest:.0f} ms, on {processor()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
