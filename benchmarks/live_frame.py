"""The time of one frame of a live figure: sliced Wasserstein with its gradient in a browser.

Run as ``python benchmarks/live_frame.py``. It prints the median of 40 frames with 678 points on each side and 100
lines, after the first frame, which includes compilation and is printed as well. The goal is 8 ms.
"""

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from meshot.view.page import joined

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
from preflight import browser  # noqa: E402

N_POINTS, N_LINES, N_FRAMES = 678, 100, 41
FRAMES = """
const random = generator(1);
const cloud = () => Array.from({ length: points }, () => [normal(random), normal(random)]);
const [x, y, directions] = [cloud(), cloud(), planeDirections("equally spaced", lines, random)];
return Array.from({ length: frames }, () => {
  const start = performance.now();
  slicedLoss(x, y, directions);
  return performance.now() - start;
});"""


def main() -> None:
    """Measure, and print the milliseconds."""
    script = joined(*(f"meshot_book/live/assets/{name}.js" for name in ("random", "transport", "projection")))
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser(), args=["--no-sandbox"])
        sizes = {"points": N_POINTS, "lines": N_LINES, "frames": N_FRAMES}
        first, *others = opened.new_page().evaluate(f"({{points, lines, frames}}) => {{ {script}\n{FRAMES} }}", sizes)
        opened.close()
    median = sorted(others)[len(others) // 2]
    print(f"{N_POINTS} points, {N_LINES} lines: first frame {first:.1f} ms, median {median:.1f} ms")


if __name__ == "__main__":
    main()
