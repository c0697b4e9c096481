"""Time of one frame of a live figure in the browser: ``python benchmarks/live_frame.py``.

678 points a side and 100 lines in motion: value and gradient of the sliced loss, one step of the descent, and the new
marks in the page, as the figure of chapter 1 does it. Medians of 100 frames, the fastest frame and the processor are
printed. The goal is 8 ms on a desk. A busy machine needs more, so this is no test.
"""

import argparse
import platform
import re
import sys
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parent.parent
sys.path += [str(ROOT / folder) for folder in ("tests", "tests/live", "tools")]

from live_pages import live_page_of  # noqa: E402

from browser import offline_browser  # noqa: E402
from preflight import browser  # noqa: E402

FRAMES = """([points, lines, frames]) => {
  const random = generator(1);
  const cloud = () => Array.from({ length: points }, () => [normal(random), normal(random)]);
  const target = cloud();
  const directions = planeDirections("equally spaced", lines, random);
  const holder = document.body.appendChild(document.createElement("div"));
  const plot = addPlot(holder, { name: "points", x: { range: [-3, 3] }, y: { range: [-3, 3] }, equal: true });
  let now = descent(cloud());
  const memory = {};
  const times = { "loss and gradient": [], "step and marks": [] };
  for (let k = 0; k < frames; k += 1) {
    const start = performance.now();
    const { gradient } = slicedLoss(now.points, target, directions, { memory });
    const between = performance.now();
    now = descend(now, gradient, { rate: points / 4, momentum: 0.5 });
    plot.clear();
    plot.dots(now.points, { colour: "black" });
    holder.getBoundingClientRect();
    times["loss and gradient"].push(between - start);
    times["step and marks"].push(performance.now() - between);
  }
  for (const values of Object.values(times)) {
    values.sort((s, t) => s - t);
  }
  return times;
}"""


def main() -> int:
    """Time the frames from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=678)
    parser.add_argument("--lines", type=int, default=100)
    parser.add_argument("--frames", type=int, default=100)
    given = parser.parse_args()
    # All modules of the figure, without the call that wakes it.
    script = re.search(r"<script>\s*\(\(\) => \{(.*)\nwake\(", live_page_of("descent").html, re.DOTALL)[1]
    with offline_browser(browser()) as context:
        page = context.new_page()
        call = f"given => {{ {script}\nreturn ({FRAMES})(given); }}"
        times = page.evaluate(call, [given.points, given.lines, given.frames])
    fastest = sum(values[0] for values in times.values())
    for name, values in times.items():
        print(f"{name}: {median(values):.1f} ms")
    print(f"a frame: {sum(map(median, times.values())):.1f} ms, the fastest {fastest:.1f} ms, on {processor()}")
    return 0


def processor() -> str:
    file = Path("/proc/cpuinfo")
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())
