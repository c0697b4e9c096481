"""Planted errors: their sections and their table."""

import numpy as np
import pytest
import torch

from meshot.mesh.shapes import icosphere
from meshot_book.defects import shifted
from meshot_book.figures.measures.planted import Window, ratio_figure, round_length, sections_figure

SPHERE = icosphere(3, 10.0)
WINDOW = Window(torch.tensor([0.0, 0.0, 10.0], dtype=torch.float64), 1, 6.0)


def test_a_section_of_a_sphere_is_a_circle():
    lines = WINDOW.lines(SPHERE)
    radii = np.hypot(lines[:, :, 0], lines[:, :, 1] + 10)
    np.testing.assert_allclose(radii, 10, atol=0.1)
    assert np.abs(lines).max(axis=(1, 2)).min() <= 6
    assert 5 < len(lines) < 60


def test_chains_join_the_lines_of_a_section_and_end_at_its_window():
    lines, chains = WINDOW.lines(SPHERE), WINDOW.chains(SPHERE)
    (chain,) = (np.reshape(chain, (-1, 2)) for chain in chains)  # the cap of the sphere is one open line
    radii = np.hypot(chain[:, 0] / 400 * 6, chain[:, 1] / 400 * 6 + 10)
    np.testing.assert_allclose(radii, 10, atol=0.1)
    pairs = {frozenset(map(tuple, pair)) for pair in lines.round(6).tolist()}  # edges in the plane belong to two faces
    unique = [pair for pair in pairs if len(pair) == 2]
    assert len(chain) == len(unique) + 1
    assert np.abs(chain).max() == 400
    assert set(np.abs(chain[[0, -1]]).max(axis=1)) == {400}
    whole = Window(torch.zeros(3, dtype=torch.float64), 2, 12.0)
    (ring,) = (np.reshape(chain, (-1, 2)) for chain in whole.chains(SPHERE))
    assert ring[0].tolist() == ring[-1].tolist()
    length = np.linalg.norm(np.diff(ring, axis=0), axis=1).sum() / 400 * 12
    assert length == pytest.approx(2 * np.pi * 10, rel=0.01)


def test_sections_show_target_and_error():
    figure = sections_figure({"shift": (WINDOW, shifted(SPHERE, (0.0, 0.0, 1.0)))}, SPHERE, columns=2)
    shown, hidden = figure.axes
    target, damaged = shown.collections
    tops = [np.concatenate(part.get_segments())[:, 1].max() for part in (target, damaged)]
    assert tops[1] - tops[0] == pytest.approx(1, abs=1e-6)
    assert not hidden.get_visible()


@pytest.mark.parametrize(("half", "length"), [(22, 10), (16, 5), (8, 2), (4, 2), (0.3, 0.1)])
def test_bars_of_scale_are_round(half, length):
    assert round_length(half) == pytest.approx(length)


def test_the_table_colours_what_stands_out():
    figure = ratio_figure(
        [["a", "b"], ["c", "d"]], np.array([[0.5, 3.0], [np.inf, 2.0]]), ["x", "y"], ["p", "q"], "times"
    )
    data = figure.axes[0].images[0].get_array()
    assert np.ma.getmaskarray(np.ma.masked_invalid(data)).tolist() == [[True, False], [False, True]]
    assert float(data[1, 0]) == 50
    assert [text.get_text() for text in figure.axes[0].texts] == ["a", "b", "c", "d"]


def test_the_table_refuses_what_does_not_fit():
    with pytest.raises(ValueError, match=r"\(1, 2\) is needed"):
        ratio_figure([["a", "b"]], np.ones((2, 2)), ["x"], ["p", "q"], "times")
