"""What the stored notebooks must be: run, paired, described, and watched by nbval."""

import ast
import base64
import copy
import functools
import io
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import nbformat
import numpy as np
import pytest
from PIL import Image

from plain import plain_notebook
from run_notebooks import lighten_pictures, retold_notebook
from stored_notebooks import run_nbval

ROOT = Path(__file__).resolve().parent.parent
STORED = sorted((ROOT / "notebooks").glob("[0-9]*.ipynb"))
IGNORED_BUDGET = 2  # cells a chapter beside live figures: the environment card, and one picture that moves
IGNORED = {"nbval-ignore-output", "nbval-skip", "nbval-raises-exception"}


@functools.cache
def read(path: Path) -> nbformat.NotebookNode:
    """A notebook, which no test may change."""
    return nbformat.read(path, as_version=4)


def tags(cell: nbformat.NotebookNode) -> set[str]:
    return set(cell.metadata.get("tags", []))


def code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    return [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]


def text_of(cell: nbformat.NotebookNode) -> str:
    streams = [o.text for o in cell.outputs if o.output_type == "stream"]
    return "".join(streams + [o.data.get("text/plain", "") for o in cell.outputs if "data" in o])


def pictures_without_words(notebook: nbformat.NotebookNode) -> list[str]:
    """Cells that show a picture without alternative text of at least a sentence."""
    bare = []
    for cell in code_cells(notebook):
        shows = any(key.startswith("image/") for o in cell.outputs for key in o.get("data", {}))
        alt = cell.metadata.get("mystnb", {}).get("image", {}).get("alt", "")
        if shows and len(alt.split()) < 6:
            bare.append(cell.source[:60])
    return bare


def unmentioned_figures(notebook: nbformat.NotebookNode) -> list[str]:
    """Figures and tables with a caption to which no text of the chapter refers."""
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    figures = [cell.metadata.get("mystnb", {}).get("figure", {}) for cell in code_cells(notebook)]
    return [figure["name"] for figure in figures if "name" in figure and f"(#{figure['name']})" not in text]


def exercises(notebook: nbformat.NotebookNode) -> list[tuple[str, str]]:
    """For each exercise the verdict on its stub and the verdict on its solution."""
    pairs, waiting = [], None
    for cell in code_cells(notebook):
        printed = text_of(cell).strip()
        if "solution" in tags(cell):
            pairs.append((waiting or "", printed))
            waiting = None
        elif printed.startswith(("✓", "✗")):
            waiting = printed
    return pairs


chapters = pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)


def test_every_source_is_stored_and_every_stored_notebook_has_a_source():
    sources = {path.stem for path in (ROOT / "notebooks").glob("[0-9]*.md")}
    assert sources == {path.stem for path in STORED}
    assert sources


@chapters
def test_it_is_the_plain_form_of_its_source(path):
    assert read(path) == plain_notebook(retold_notebook(path.with_suffix(".md")), path.stem)


@chapters
def test_a_chapter_has_one_title(path):
    titles = [
        line for cell in read(path).cells if cell.cell_type == "markdown"
        for line in cell.source.splitlines() if line.startswith("# ")
    ]  # fmt: skip
    assert len(titles) == 1
    assert titles[0].startswith(f"# {int(path.stem[:2])} ")


@chapters
def test_every_cell_was_run_in_order_without_error_or_the_name_of_a_machine(path):
    assert not re.search(r"/(home|root|work|tmp|Users)/\w", path.read_text(encoding="utf-8"))
    cells = code_cells(read(path))
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert not [o for cell in cells for o in cell.outputs if o.output_type == "error" or o.get("name") == "stderr"]


@chapters
def test_no_cell_prints_more_or_less_elsewhere(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for cell in code_cells(read(path)):
            ast.parse(cell.source)  # from Python 3.12 on a warning is printed for an invalid escape such as "\\c"
            # JupyterLab then shows no value, but nbval receives one that is not in the stored outputs.
            assert not cell.source.rstrip().endswith(";"), cell.source


@chapters
def test_pictures_have_words(path):
    assert pictures_without_words(read(path)) == []


def pictures_of(notebook: nbformat.NotebookNode) -> list[str]:
    return [o.data["image/png"] for c in code_cells(notebook) for o in c.outputs if "image/png" in o.get("data", {})]


@chapters
def test_pictures_are_light(path):
    notebook = copy.deepcopy(read(path))
    before = [len(picture) for picture in pictures_of(notebook)]
    lighten_pictures(notebook, refinements=0)
    # Another version of Pillow may need a few bytes less.
    assert [old for old, new in zip(before, map(len, pictures_of(notebook)), strict=True) if new < 0.9 * old] == []


@pytest.mark.parametrize(("n_colours", "alpha", "mode"), [(200, 255, "P"), (9000, 255, "RGB"), (200, 90, "RGBA")])
def test_a_picture_gets_a_palette_unless_that_changes_it(n_colours, alpha, mode):
    places = np.random.default_rng(0).integers(n_colours, size=(100, 100)) * (2**24 // n_colours)
    pixels = np.stack([places >> 16, places >> 8 & 255, places & 255, np.full_like(places, alpha)], -1)
    image, file = Image.fromarray(pixels.astype(np.uint8)), io.BytesIO()
    image.save(file, "PNG", dpi=(90, 90), compress_level=1)
    data = {"image/png": base64.b64encode(file.getvalue()).decode()}
    cell = nbformat.v4.new_code_cell(outputs=[nbformat.v4.new_output("display_data", data)])
    lighten_pictures(nbformat.v4.new_notebook(cells=[cell, nbformat.v4.new_markdown_cell("See it.")]))
    stored = Image.open(io.BytesIO(base64.b64decode(cell.outputs[0].data["image/png"])))
    assert (stored.mode, round(stored.info["dpi"][0])) == (mode, 90)
    assert np.array_equal(stored.convert("RGBA"), image)


@chapters
def test_every_figure_and_table_is_mentioned(path):
    assert unmentioned_figures(read(path)) == []


@chapters
def test_ignored_cells_stay_within_their_budget(path):
    ignored = [cell for cell in code_cells(read(path)) if tags(cell) & IGNORED and "live_figure(" not in cell.source]
    assert 1 <= len(ignored) <= IGNORED_BUDGET, [cell.source[:60] for cell in ignored]


@chapters
def test_solutions_pass_and_stubs_fail(path):
    pairs = exercises(read(path))
    assert len(pairs) >= 2  # beside two proofs
    for stub, solution in pairs:
        assert stub.startswith("✗"), stub
        assert solution.startswith("✓"), solution


def test_a_picture_without_words_is_seen():
    picture = nbformat.v4.new_output("display_data", data={"image/png": "iVBO"})
    cell = nbformat.v4.new_code_cell("plot()", outputs=[picture])
    assert pictures_without_words(nbformat.v4.new_notebook(cells=[cell])) == ["plot()"]


@pytest.mark.parametrize(("text", "bare"), [("See [Figure](#fig-one).", []), ("See it.", ["fig-one"])])
def test_a_figure_that_is_not_mentioned_is_seen(text, bare):
    cell = nbformat.v4.new_code_cell("plot()", metadata={"mystnb": {"figure": {"name": "fig-one"}}})
    words = nbformat.v4.new_markdown_cell(text)
    assert unmentioned_figures(nbformat.v4.new_notebook(cells=[words, cell])) == bare


def test_nbval_sees_one_altered_number_and_nothing_else(tmp_path):
    """In a copy of chapter 1 up to its first printed number."""
    notebook = copy.deepcopy(read(STORED[0]))
    numbered = next(i for i, c in enumerate(notebook.cells) if c.cell_type == "code" and re.search(r"\d", text_of(c)))
    notebook.cells = notebook.cells[: numbered + 1]
    output = notebook.cells[-1].outputs[0]
    holder, key = (output, "text") if "text" in output else (output.data, "text/plain")
    before = holder[key]
    holder[key] = re.sub(r"\d", lambda digit: str((int(digit[0]) + 1) % 10), before, count=1)
    assert holder[key] != before
    nbformat.write(notebook, tmp_path / "altered.ipynb")
    result = run_nbval(tmp_path / "altered.ipynb")
    assert result.returncode == 1
    assert "mismatch" in result.stdout
    assert re.search(r"\b1 failed, [1-9]\d* passed", result.stdout), result.stdout


def start_in_a_process(n_starts: int, **extra: str) -> subprocess.CompletedProcess:
    command = [sys.executable, str(Path(__file__).with_name("start_kernels.py")), str(n_starts)]
    return subprocess.run(command, env=os.environ | extra, capture_output=True, encoding="utf-8", check=False)


def test_error_output_of_a_kernel_is_kept():
    ended = start_in_a_process(1, IPYTHONDIR=f"{__file__}/nowhere")
    assert "not a writable location" in ended.stderr


def test_kernels_that_start_side_by_side_answer():
    ended = start_in_a_process(6)
    assert ended.returncode == 0
    assert "{'answered': 6}" in ended.stdout
