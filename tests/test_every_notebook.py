"""Every stored notebook runs again and gives its stored outputs; some a second time as an older CPU would."""

import pytest

from meshot_book.notebook.environment import stated_seconds
from stored_notebooks import NOTEBOOKS, run_nbval

#: All chapters; those that took longest when their outputs were stored come first.
CHAPTERS = sorted(NOTEBOOKS.glob("[0-9]*.ipynb"), key=lambda path: -stated_seconds(path.read_text(encoding="utf-8")))
#: Run a second time with torch's plain code path instead of the vectorised one: points, meshes, a real image.
ON_AN_OLDER_CPU = ("01_circle_to_polygon", "07_mesh_as_measure", "23_a_real_scan")


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda path: path.stem)
def test_its_outputs_are_the_stored_ones(path):
    ended = run_nbval(path)
    assert ended.returncode == 0, ended.stdout


@pytest.mark.thorough
@pytest.mark.parametrize("name", ON_AN_OLDER_CPU)
def test_its_outputs_are_the_stored_ones_on_an_older_cpu(name):
    ended = run_nbval(NOTEBOOKS / f"{name}.ipynb", ATEN_CPU_CAPABILITY="default")
    assert ended.returncode == 0, ended.stdout
