"""The page of crossing triangles: what it says is what Python computes, at every setting, without a network."""

import itertools
import re

import pytest
import torch

from browser import page_file, set_width, watched_page
from meshot_book.examples.counterexample import crossing_sides, crossing_time
from meshot_book.figures.flows.flow import FIELDS, crossing_figure, crossing_player, outlines, two_triangles

SETTINGS = [
    (name, time, steps, exponent)
    for name, (time, steps), exponent in itertools.product(FIELDS, [(0.3, 8), (0.31, 8), (0.6, 1), (0.9, 64)], (0, 4))
]


def turn(a, b, c):
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return (area > 0) - (area < 0)


def crossing_pairs(shapes):
    """Slow twin: every side of every outline against every other."""
    sides = [(p, q) for shape in shapes.tolist() for p, q in zip(shape, shape[1:] + shape[:1], strict=True)]
    return sum(
        turn(*s, t[0]) * turn(*s, t[1]) < 0 and turn(*t, s[0]) * turn(*t, s[1]) < 0
        for s, t in itertools.combinations(sides, 2)
    )


def set_to(page, name, value):
    page.eval_on_selector(
        f"input.{name}", "(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", str(value)
    )


def test_the_page_counts_what_python_counts(tmp_path, context):
    file = page_file(tmp_path, crossing_player("two triangles"))
    corners, seen = two_triangles(), set()
    with watched_page(context, file) as (page, troubles):
        set_width(page, 400)
        assert page.is_visible("canvas")
        assert not page.is_visible("img")
        for name, time, steps, exponent in SETTINGS:
            page.check(f"input[value={name}]")
            for control, value in (("time", time), ("steps", steps), ("pieces", exponent)):
                set_to(page, control, value)
            found = page.eval_on_selector(".crossing-player", "e => ({ ...e.dataset })")
            moved = outlines(FIELDS[name], corners, time, steps, 2**exponent)
            wanted = crossing_pairs(moved)
            assert crossing_sides(moved) == wanted
            assert int(found["pairs"]) == wanted
            bound = time / steps * float(FIELDS[name].lipschitz_bound())
            assert float(found["bound"]) == pytest.approx(bound)
            said = page.inner_text(".verdict")
            assert ("No sides cross" in said) is (wanted == 0)
            assert ("no two points" in said) is (bound < 1)
            seen.add((wanted > 0, bound < 1))
        page.focus("input.time")
        page.keyboard.press("Home")
        assert page.eval_on_selector(".crossing-player", "e => e.dataset.pairs") == "0"
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        assert troubles == []
    assert seen == set(itertools.product((True, False), repeat=2))


def test_the_push_crosses_at_the_moment_of_the_formula():
    corners, moment = two_triangles(0.3), crossing_time(0.3, FIELDS["push"])
    for time, pairs in ((moment - 1e-6, 0), (moment + 1e-6, 2)):
        assert crossing_pairs(outlines(FIELDS["push"], corners, time, 5, 1)) == pairs


def test_outlines_start_as_they_are():
    shapes = outlines(FIELDS["whirl"], two_triangles(), 0.0, 3, 4)
    assert shapes.shape == (2, 12, 2)
    assert torch.equal(shapes[:, ::4], two_triangles())
    torch.testing.assert_close(shapes[0, 1], torch.tensor([-0.75, -0.25]).double())


def test_still_picture_shows_both_outlines():
    figure = crossing_figure(FIELDS["push"], 0.3, 0.6, 8, (1, 16))
    assert [ax.get_title() for ax in figure.axes] == ["corners only", "sides in 16 pieces"]
    assert all(len(ax.patches) == len(ax.lines) == 2 for ax in figure.axes)


def test_page_reaches_nowhere_and_names_itself():
    page = crossing_player('a "b"').html
    assert not re.search(r"\{[{%]|https?:|src=\"(?!data:)", page)
    assert 'aria-label="a &#34;b&#34;"' in page
    assert "run the cell" in repr(crossing_player("x"))


@pytest.mark.parametrize("gap", [0.0, 1.0])
def test_doors(gap):
    with pytest.raises(ValueError, match=f"gap is {gap}"):
        two_triangles(gap)
