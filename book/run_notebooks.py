"""Run the chapters from their text sources, and write their notebooks in plain Markdown (``plain``).

``store [NAME ...]``   run and store the outputs beside the sources, in ``notebooks/``: what nbval compares
``text [NAME ...]``    run nothing: take over text, tags and captions, and keep the outputs of code that is unchanged
``fresh [NAME ...]``   run into ``build/notebooks``, several at a time, and leave every tracked file as it is
"""

import argparse
import base64
import io
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import zip_longest
from pathlib import Path

from kernels import SeparateKernelManager  # isort: skip: before nbformat
import nbformat
import numpy as np
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from PIL import Image
from tqdm import tqdm

from meshot.files import whole_file
from meshot_book.notebook import KERNEL_ENVIRONMENT, stated_seconds
from plain import plain_notebook, source_notebook

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = ROOT / "notebooks"
CELL_TIMEOUT = 600
#: Notebooks that run at a time, of up to one and a half gigabytes each.
MOST_AT_ONCE = 4
#: Mean difference, in levels of 256, that 256 colours may make in a picture. Colour bars show bands from about .7 on.
MOST_DIFFERENCE = 0.5


def run_notebook(source: Path, bar: tqdm) -> nbformat.NotebookNode:
    """Run a text source in a fresh kernel and return it, in MyST as it is, with its outputs."""
    notebook = source_notebook(source)
    client = NotebookClient(
        notebook,
        timeout=CELL_TIMEOUT,
        kernel_name="python3",
        kernel_manager_class=SeparateKernelManager,
        extra_arguments=["--log-level=40"],
        record_timing=False,
        coalesce_streams=True,  # a busy machine may hand over one print in two pieces
        resources={"metadata": {"path": str(NOTEBOOKS)}},
        on_cell_executed=lambda cell, cell_index, execute_reply: bar.update(),
    )
    client.execute()
    # What differs between machines and says nothing: the version of the language, the ids of widgets, times.
    notebook.metadata.pop("language_info", None)
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
    return notebook


def lighten_pictures(notebook: nbformat.NotebookNode, refinements: int = 1) -> None:
    """Store the opaque PNG pictures among the outputs with 256 colours where no bands show, and none with transparency.

    A picture that would not become smaller stays as it is. ``refinements`` is the threshold of Pillow's k-means; with 0
    the colours are chosen fast and less well.
    """
    for output in (output for cell in notebook.cells for output in cell.get("outputs", [])):
        if "image/png" not in output.get("data", {}):
            continue
        before = base64.b64decode(output.data["image/png"])
        with Image.open(io.BytesIO(before)) as image:
            if image.mode == "P" or image.convert("RGBA").getextrema()[3][0] < 255:
                continue
            colours, dpi = image.convert("RGB"), image.info.get("dpi")
        palette = colours.quantize(256, Image.Quantize.MEDIANCUT, refinements, dither=Image.Dither.NONE)
        difference = np.abs(np.asarray(colours, float) - np.asarray(palette.convert("RGB"))).mean()
        after = io.BytesIO()
        (palette if difference <= MOST_DIFFERENCE else colours).save(after, "PNG", optimize=True, dpi=dpi)
        if len(after.getvalue()) < len(before):
            output.data["image/png"] = base64.b64encode(after.getvalue()).decode()


def retold_notebook(source: Path, notebooks: Path | None = None) -> nbformat.NotebookNode:
    """A text source, in MyST as it is, with the outputs that its notebook holds, beside it or in another folder."""
    notebook = source_notebook(source)
    stored = nbformat.read((notebooks or source.parent) / f"{source.stem}.ipynb", as_version=4)
    new, old = ([cell for cell in n.cells if cell.cell_type == "code"] for n in (notebook, stored))
    for number, (cell, before) in enumerate(zip_longest(new, old), 1):
        if cell is None or before is None or cell.source != before.source:
            raise ValueError(
                f"{source.stem}: code cell {number} has changed; run it: make notebooks NAME={source.stem}"
            )
        cell["outputs"], cell["execution_count"] = before.outputs, before.execution_count
    return notebook


def write_run(source: Path, into: Path) -> None:
    """Run one text source, with a progress bar, and write the notebook."""
    n_code = sum(cell.cell_type == "code" for cell in source_notebook(source).cells)
    started = time.perf_counter()
    with tqdm(total=n_code, desc=source.stem, unit="cell", file=sys.stdout, mininterval=1) as bar:
        notebook = run_notebook(source, bar)
    if into == NOTEBOOKS:
        lighten_pictures(notebook)
    with whole_file(into / f"{source.stem}.ipynb") as temporary:
        nbformat.write(plain_notebook(notebook, source.stem), temporary)
    print(f"{source.stem}: {time.perf_counter() - started:.0f} s", flush=True)


def write_fresh_runs(sources: list[Path]) -> None:
    """Run several text sources side by side, each in a process of its own, the longest first."""

    def seconds_before(source: Path) -> int:
        stored = source.with_suffix(".ipynb")
        return stated_seconds(stored.read_text(encoding="utf-8")) if stored.is_file() else 0

    ordered = sorted(sources, key=seconds_before, reverse=True)
    workers = min(os.cpu_count() or 1, MOST_AT_ONCE)
    with (
        tqdm(total=len(ordered), desc="notebooks", unit="notebook", file=sys.stdout) as bar,
        ThreadPoolExecutor(workers) as pool,
    ):
        waiting = {pool.submit(_run_alone, source): source for source in ordered}
        for done in as_completed(waiting):
            ended = done.result()
            if ended.returncode:
                pool.shutdown(wait=False, cancel_futures=True)
                raise ValueError(ended.stdout)
            bar.set_postfix_str(ended.stdout.strip().splitlines()[-1])
            bar.update()


def _run_alone(source: Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, __file__, "fresh", source.stem],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False,
    )  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Treat the named notebooks, or all of them; the exit status is 1 if one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mode", choices=("store", "text", "fresh"))
    parser.add_argument("names", nargs="*", help="such as 01_circle_to_polygon; all of them if left out")
    options = parser.parse_args(arguments)
    sources = [NOTEBOOKS / f"{Path(name).stem}.md" for name in options.names] or sorted(NOTEBOOKS.glob("[0-9]*.md"))
    missing = [source.name for source in sources if not source.is_file()]
    if missing:
        known = ", ".join(path.stem for path in sorted(NOTEBOOKS.glob("[0-9]*.md")))
        print(f"no such notebook: {', '.join(missing)}; there are {known}")
        return 1
    os.environ.update(KERNEL_ENVIRONMENT)
    if options.mode == "fresh" and len(sources) > 1:
        try:
            write_fresh_runs(sources)
        except ValueError as error:
            print(f"\n{error}")
            return 1
        return 0
    for source in sources:
        try:
            if options.mode == "text":
                with whole_file(source.with_suffix(".ipynb")) as temporary:
                    nbformat.write(plain_notebook(retold_notebook(source), source.stem), temporary)
            else:
                write_run(source, NOTEBOOKS if options.mode == "store" else ROOT / "build" / "notebooks")
        except (CellExecutionError, ValueError) as error:
            print(f"\n{source.stem} failed:\n{error}")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
