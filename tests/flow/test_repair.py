"""Faces that cross after a flow: mended, or brought back, and never left."""

import pytest
import torch

from meshot.flow.crossings import repair_crossings
from meshot.mesh import Mesh
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.shapes import folded_sphere, icosphere

BALL = icosphere(4, 10.0)


def test_what_does_not_cross_is_left_alone():
    carried = BALL.with_vertices(BALL.vertices * 1.3 + 5)
    found = repair_crossings(BALL, carried)
    assert found.mesh is carried
    assert (found.n_crossing, found.n_backtracks, found.largest_move) == (0, 0, 0.0)


def with_an_edge_turned() -> Mesh:
    """The ends of one edge change places, a little outside: a few faces cross."""
    carried = BALL.vertices.clone()
    edge = BALL.faces[2000, :2]
    carried[edge] = carried[edge].flip(0) * 1.05
    return BALL.with_vertices(carried)


def test_a_small_defect_is_smoothed_and_the_rest_stays():
    crossed = with_an_edge_turned()
    found = repair_crossings(BALL, crossed)
    assert found.n_crossing == len(self_intersecting_faces(crossed)) > 0
    assert len(self_intersecting_faces(found.mesh)) == 0
    assert found.n_backtracks == 0
    assert int((found.mesh.vertices != crossed.vertices).any(dim=1).sum()) < 60
    assert found.largest_move == float((found.mesh.vertices - crossed.vertices).norm(dim=1).max()) > 0


def with_pole_pushed_through(depth: float) -> torch.Tensor:
    """The northern cap goes down, through the southern one."""
    z = BALL.vertices[:, 2:]
    cap = ((z - 7.0) / 3).clamp(min=0)
    return torch.cat([BALL.vertices[:, :2], z - depth * cap], dim=1)


def test_what_smoothing_cannot_mend_goes_back_in_places():
    carried = BALL.with_vertices(with_pole_pushed_through(25.0) + torch.tensor([1.0, 0, 0]))
    found = repair_crossings(BALL, carried, max_rounds=3)
    assert found.n_crossing > 0
    assert found.n_backtracks > 0
    assert len(self_intersecting_faces(found.mesh)) == 0
    equator = (BALL.vertices[:, 2].abs() < 1).nonzero()[:, 0]
    torch.testing.assert_close(found.mesh.vertices[equator], carried.vertices[equator])
    assert float((found.mesh.vertices - BALL.vertices).norm(dim=1).max()) > 0.5


def test_more_than_the_largest_share_is_not_smoothed_alone():
    """The same defect goes back when fewer faces may cross, and is smoothed away when as many may."""
    crossed = with_an_edge_turned()
    share = len(self_intersecting_faces(crossed)) / len(BALL.faces)
    assert repair_crossings(BALL, crossed, largest_share=share).n_backtracks == 0
    assert repair_crossings(BALL, crossed, largest_share=0.9 * share).n_backtracks > 0


def test_more_rounds_need_fewer_backtracks():
    crossed = BALL.with_vertices(with_pole_pushed_through(21.0) + torch.tensor([1.0, 0, 0]))
    few, many = (repair_crossings(BALL, crossed, max_rounds=n, largest_share=1.0) for n in (3, 40))
    assert (few.n_backtracks, many.n_backtracks) == (1, 0)


def test_in_the_end_the_initial_surface_is_what_is_left():
    """Smoothed until nothing crosses it would be a ball, and no folds left."""
    initial = folded_sphere(3)
    wild = initial.vertices + 20 * torch.randn(initial.vertices.shape, generator=torch.Generator().manual_seed(0))
    found = repair_crossings(initial, initial.with_vertices(wild), max_backtracks=1)
    assert len(self_intersecting_faces(found.mesh)) == 0
    assert torch.equal(found.mesh.vertices, initial.vertices)


def test_doors():
    with pytest.raises(ValueError, match="other faces"):
        repair_crossings(BALL, icosphere(3, 10.0))
    with pytest.raises(ValueError, match="max_backtracks is 0"):
        repair_crossings(BALL, BALL, 0)
    with pytest.raises(ValueError, match="max_rounds is 0"):
        repair_crossings(BALL, BALL, max_rounds=0)
    for share in (0, 1.5, float("nan")):
        with pytest.raises(ValueError, match="largest_share is"):
            repair_crossings(BALL, BALL, largest_share=share)
    crossed = BALL.with_vertices(with_pole_pushed_through(25.0))
    with pytest.raises(ValueError, match="initial surface has self-intersecting faces"):
        repair_crossings(crossed, crossed)
