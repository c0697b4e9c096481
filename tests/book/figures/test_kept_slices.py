"""Kept slices of spheres: lines are whole, distances have the right sign, and files and pages hold what was cut."""

import numpy as np
import pytest
import torch

from meshot.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import Surface
from meshot.volume.volume import Volume
from meshot_book.figures.cortex.kept_slices import (
    LIVE_STEP_MM,
    KeptSlice,
    cut_slice,
    joined_lines,
    kept_slices_figure,
    live_numbers,
    live_slices,
    read_slices,
    thinned,
    unpacked_lines,
    write_slices,
)

AFFINE = np.eye(4)
AFFINE[:3, 3] = -15.5
SCAN = Volume(np.full((32, 32, 32), 70.0), AFFINE)


def sphere(radius: float, shift: float = 0.0) -> Mesh:
    mesh = icosphere(5, radius)
    return mesh.with_vertices(mesh.vertices.double() + torch.tensor([shift, 0.0, 0.0]))


@pytest.fixture(scope="module")
def kept() -> KeptSlice:
    """The middle of a sphere of radius 9 inside one of radius 10."""
    return cut_slice(SCAN, "coronal", 0.1, [sphere(9.0)], [Surface(sphere(10.0))], 0.01)


def length(line: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def test_segments_in_any_order_and_direction_become_whole_lines():
    angles = np.linspace(0, 2 * np.pi, 41)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ring[-1] = ring[0]
    path = np.array([[5.0, 0.0], [6.0, 1.0], [7.0, 0.0], [8.0, 1.0]])
    pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in (ring, path)])
    rng = np.random.default_rng(0)
    pieces = pieces[rng.permutation(len(pieces))]
    flipped = rng.random(len(pieces)) < 0.5
    pieces[flipped] = pieces[flipped, ::-1]
    pieces = pieces + 1e-6 * rng.uniform(-1, 1, pieces.shape)  # last bits differ between faces
    found = sorted(joined_lines(np.concatenate([pieces, pieces[:1, :1].repeat(2, axis=1)])), key=len)
    assert [len(line) for line in found] == [4, 41]
    assert length(found[0]) == pytest.approx(length(path), abs=1e-3)
    assert length(found[1]) == pytest.approx(length(ring), abs=1e-3)
    assert (found[1][0] == found[1][-1]).all()


def test_a_thinned_line_keeps_within_its_tolerance():
    x = np.linspace(0, 10, 400)
    wave = np.stack([x, np.sin(x)], axis=1)
    kept = thinned(wave, 0.05)
    assert {0, 399} < set(kept)
    assert len(kept) < 40
    straight = np.interp(x, x[kept], wave[kept, 1])
    assert np.abs(straight - wave[:, 1]).max() < 0.08  # along the vertical, which is more than across
    assert thinned(np.stack([x, 2 * x], axis=1), 1e-6) == [0, 399]
    ring = np.stack([np.cos(x), np.sin(x)], axis=1)[:252]
    ring[-1] = ring[0]  # its ends coincide
    assert len(thinned(ring, 0.01)) > 10


def test_a_slice_has_lines_and_signed_distances(kept):
    assert kept.image.dtype == np.uint8
    assert set(np.unique(kept.image)) == {70}
    (ours,), (theirs,) = kept.found, kept.reference
    assert length(ours) == pytest.approx(2 * np.pi * 9, rel=0.01)
    assert length(theirs) == pytest.approx(2 * np.pi * 10, rel=0.01)
    np.testing.assert_allclose(kept.signed[0], -1, atol=0.03)


def test_a_file_returns_what_was_written(kept, tmp_path):
    both = [kept, cut_slice(SCAN, "axial", 9.5, [sphere(9.0)], [Surface(sphere(10.0))], 0.01)]
    write_slices(tmp_path / "s.safetensors.gz", both)
    again = read_slices(tmp_path / "s.safetensors.gz")
    assert [(each.plane, each.position, each.extent) for each in again] == [
        (each.plane, each.position, each.extent) for each in both
    ]
    assert [len(each.found) for each in again] == [1, 0]
    for one, other in zip(again, both):
        np.testing.assert_array_equal(one.image, other.image)
        for name in ("found", "reference", "signed"):
            for a, b in zip(getattr(one, name), getattr(other, name), strict=True):
                np.testing.assert_allclose(a, b, atol=0.0051)


def test_the_page_holds_the_lines_and_far_steps_too(kept):
    far = np.array([[0.0, 0.0], [12.7, -12.8], [-60.0, 50.0], [-59.9, 50.1]])
    given = KeptSlice("coronal", 0.1, kept.image, kept.extent, [*kept.found, far], kept.reference,
                      [*kept.signed, np.array([0.0, 9.0, -9.0, 0.5])])  # fmt: skip
    (page,) = live_slices([given], 0.05, 50)
    first, second = unpacked_lines(page["found"])
    np.testing.assert_allclose(second, far, atol=LIVE_STEP_MM / 2 + 1e-9)
    assert length(first) == pytest.approx(2 * np.pi * 9, rel=0.01)
    (alone,) = live_slices([kept], 0.05, 50)
    (numbers,) = live_numbers([alone], 0.9)
    assert numbers["length"] == pytest.approx(2 * np.pi * 9, rel=0.01)
    assert numbers["mean"] == pytest.approx(-1, abs=0.04)
    assert numbers["beyond"] == 1
    assert live_numbers([alone], 1.1)[0]["beyond"] == 0


def test_every_panel_has_both_lines_its_window_and_its_mark(kept):
    figure = kept_slices_figure({"a": kept, "b": kept}, ("ours", "theirs"), {"b": (-5, 5, 0, 10)}, {"b": {"X": (0, 5)}})
    first, second = (ax for ax in figure.axes if ax.images)
    assert first.get_xlim() == (kept.extent[0], kept.extent[1])
    assert second.get_ylim() == (0, 10)
    assert [text.get_text() for text in second.texts] == ["X"]
    for ax in (first, second):
        thick, thin = ax.collections
        assert thick.get_linewidth()[0] > thin.get_linewidth()[0]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["theirs", "ours"]
