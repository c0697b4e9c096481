"""The picture of time and memory: a line for every peer, a legend over no data, the door."""

import matplotlib.pyplot as plt
import pytest

from meshot_book.figures.measures.cost import FAMILY_COLOURS, cost_figure

ROWS = [
    {"peer": peer, "d": d, "m": m, "seconds": factor * m}
    for peer, factor in (
        ("sliced, fused", 1e-6),
        ("sliced, POT", 1.02e-6),
        ("Chamfer, k-d tree", 1.01e-6),
        ("Sinkhorn, OTT lazy", 1e-3),
        ("np.argsort, both sides", 0.99e-6),
    )
    for d in (3, 6)
    for m in (1000, 10_000)
]


def test_lines_and_names():
    figure = cost_figure(ROWS, "seconds", "time (ms)", 1e3)
    figure.canvas.draw()
    assert len(figure.axes) == 2
    for ax in figure.axes:
        assert ax.get_xscale() == ax.get_yscale() == "log"
        lines = {line.get_color() for line in ax.lines}
        assert lines == {FAMILY_COLOURS[family] for family in ("sliced", "Chamfer", "Sinkhorn", "np.argsort")}
        assert ax.lines[0].get_ydata().tolist() == pytest.approx([1.0, 10.0])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(dict.fromkeys(row["peer"] for row in ROWS))
    assert legend.get_window_extent().y0 >= figure.axes[0].get_window_extent().y1  # above the panels, over no data
    members = {(line.get_marker(), str(line.get_linestyle())) for line in figure.axes[0].lines[:2]}
    assert len(members) == 2
    plt.close(figure)


def test_door():
    with pytest.raises(ValueError, match="no row has 'bytes'"):
        cost_figure(ROWS, "bytes", "memory (MB)")
