"""The drawing of a system: every box is said and connected, and kinds differ without their colour."""

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import pytest

from meshot.systems import get_system, read_settings
from meshot_book.figures.cortex.system_rows import system_steps
from meshot_book.figures.cortex.systems import SystemStep, system_figure

ROWS = [
    [SystemStep("data", ("scan",)), SystemStep("data", ("template",))],
    [SystemStep("learned", ("network", "of one kind"), 12345)],
    [SystemStep("fixed", ("flow",))],
]


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_everything_is_said_and_connected():
    (ax,) = system_figure(ROWS).axes
    said = [text.get_text() for text in ax.texts if text.get_text()]
    assert said == [
        "scan",
        "template",
        "network\nof one kind\nlearns 12 345 weights",
        "flow",
        "data",
        "learned",
        "fixed",
    ]
    arrows = [text for text in ax.texts if not text.get_text()]
    assert len(arrows) == 2 + 1
    assert all(arrow.xyann[1] > arrow.xy[1] for arrow in arrows)


def test_kinds_differ_in_dashes_or_width():
    (ax,) = system_figure(ROWS).axes
    looks = {(patch.get_linestyle(), patch.get_linewidth()) for patch in ax.patches if patch.get_height() > 0.1}
    assert len(looks) == 3


@pytest.mark.parametrize("name", [None, "classical", "deepcsr", "vox2cortex", "corticalflow", "cortexode", "ddot"])
def test_text_stays_in_its_box(name):
    plt.rcParams["font.size"] = 14
    figure = system_figure(system_steps(name, read_settings(get_system(name), "small")) if name else ROWS)
    figure.canvas.draw()
    (ax,) = figure.axes
    boxes = [patch.get_window_extent() for patch in ax.patches]
    for text, box in zip([text for text in ax.texts if text.get_text()], boxes):
        inside = text.get_window_extent()
        assert box.x0 < inside.x0
        assert inside.x1 < box.x1
        assert box.y0 - 2 < inside.y0
        assert inside.y1 < box.y1 + 2


def test_one_weight_is_one():
    assert SystemStep("learned", ("threshold",), 1).text == "threshold\nlearns 1 weight"


def test_what_cannot_be_drawn_is_refused(unchecked):
    with pytest.raises(ValueError, match="kind is 'magic'; one of data, learned, fixed"):
        SystemStep("magic", ("x",))
    with pytest.raises(ValueError, match="a step of kind fixed has 3 weights"):
        SystemStep("fixed", ("x",), 3)
    with pytest.raises(ValueError, match="a step of kind learned has 0 weights"):
        SystemStep("learned", ("x",))
    with pytest.raises(ValueError, match=r"with \[3\] boxes in some; rows of one or two"):
        system_figure([[ROWS[0][0]] * 3])
    with pytest.raises(ValueError, match="0 rows came"):
        system_figure([])
