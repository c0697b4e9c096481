"""Run the notebooks from their text sources.

``store [NAME ...]``   run and store the outputs beside the sources, in ``notebooks/``: what nbval compares
``fresh [NAME ...]``   run into ``build/notebooks``, and leave every tracked file as it is
"""

import argparse
import os
import sys
import time
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from tqdm import tqdm

from meshot.files import whole_file
from meshot_book.notebook import KERNEL_ENVIRONMENT

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = ROOT / "notebooks"
CELL_TIMEOUT = 600


def source_notebook(source: Path) -> nbformat.NotebookNode:
    """The notebook of a text source, with cell ids that do not change from run to run."""
    notebook = jupytext.read(source)
    for index, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{index:03d}"
    return notebook


def run_notebook(source: Path, bar: tqdm) -> nbformat.NotebookNode:
    """Run a text source in a fresh kernel and return it with its outputs.

    Raises
    ------
    CellExecutionError
        As soon as a cell fails.
    """
    notebook = source_notebook(source)
    client = NotebookClient(
        notebook,
        timeout=CELL_TIMEOUT,
        kernel_name="python3",
        extra_arguments=["--log-level=40"],
        record_timing=False,
        coalesce_streams=True,  # a busy machine may hand over one print in two pieces
        resources={"metadata": {"path": str(NOTEBOOKS)}},
        on_cell_executed=lambda cell, cell_index, execute_reply: bar.update(),
    )
    client.execute()
    _drop_traces(notebook)
    return notebook


def _drop_traces(notebook: nbformat.NotebookNode) -> None:
    """Remove what differs between machines and says nothing: the version of the language, the ids of widgets."""
    notebook.metadata.pop("language_info", None)
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)


def main(arguments: list[str] | None = None) -> int:
    """Run the named notebooks, or all of them; the exit status is 1 if a cell failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mode", choices=("store", "fresh"))
    parser.add_argument("names", nargs="*", help="such as 01_circle_to_polygon; all of them if left out")
    options = parser.parse_args(arguments)
    sources = [NOTEBOOKS / f"{Path(name).stem}.md" for name in options.names] or sorted(NOTEBOOKS.glob("[0-9]*.md"))
    missing = [source.name for source in sources if not source.is_file()]
    if missing:
        known = ", ".join(path.stem for path in sorted(NOTEBOOKS.glob("[0-9]*.md")))
        print(f"no such notebook: {', '.join(missing)}; there are {known}")
        return 1
    os.environ.update(KERNEL_ENVIRONMENT)
    into = NOTEBOOKS if options.mode == "store" else ROOT / "build" / "notebooks"
    for source in sources:
        n_code = sum(cell.cell_type == "code" for cell in source_notebook(source).cells)
        started = time.perf_counter()
        with tqdm(total=n_code, desc=source.stem, unit="cell", file=sys.stdout, mininterval=1) as bar:
            try:
                notebook = run_notebook(source, bar)
            except CellExecutionError as error:
                bar.close()
                print(f"\n{source.stem} failed:\n{error}")
                return 1
        with whole_file(into / f"{source.stem}.ipynb") as temporary:
            nbformat.write(notebook, temporary)
        print(f"{source.stem}: {time.perf_counter() - started:.0f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
