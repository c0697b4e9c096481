"""What the guard sees, and faces that cross after a flow: mended, or brought back, and never left."""

import math

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

from meshot.flow.crossings import (
    crossings_along,
    inspect_paths,
    nest_surfaces,
    outward_directions,
    point_jacobians,
    repair_crossings,
    steps_below,
)
from meshot.flow.integration import METHODS, trajectory
from meshot.mesh import Mesh, face_normals, smooth_crossings, united, vertex_normals
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.shapes import folded_sphere, icosphere
from meshot_book.examples.counterexample import crossing_time, tip_over_face
from meshot_book.examples.unsteady import Accelerated
from meshot_book.flows import Push, rotation, spiral
from refusals import refuses

POINTS = torch.from_numpy(np.random.default_rng(0).uniform(-1, 1, (30, 2)))

PAIR = tip_over_face(0.3)


def crossings(*meshes: Mesh) -> int:
    """The number of faces that intersect others of these meshes."""
    return len(self_intersecting_faces(united(meshes)))


def test_jacobians_of_a_known_map():
    found = point_jacobians(lambda x: torch.stack([x[:, 0] * x[:, 1], x[:, 1] ** 2], dim=1), POINTS)
    x, y = POINTS.unbind(dim=1)
    torch.testing.assert_close(found, torch.stack([torch.stack([y, x], dim=1), torch.stack([0 * y, 2 * y], dim=1)], 1))
    assert not point_jacobians(lambda x: torch.ones_like(x), POINTS).any()


def test_rotation_by_euler_steps():
    report = inspect_paths(rotation(2.0), POINTS, 5)
    np.testing.assert_allclose(report.norms, 2.0)
    np.testing.assert_allclose(report.determinants, 1 + (2 / 5) ** 2)
    np.testing.assert_allclose(report.volume_factors, (1 + (2 / 5) ** 2) ** 5)
    assert report.step_times_lipschitz == pytest.approx(0.4)
    assert report.safe_steps == 3
    assert report.n_flips == 0
    assert torch.equal(report.positions, trajectory(rotation(2.0), POINTS, 5))


@pytest.mark.parametrize("method", METHODS)
def test_growth_of_a_volume_is_that_of_the_exact_flow(method):
    field = Accelerated(spiral(1.0, 0.4), 0.5)
    factors = inspect_paths(field, POINTS, 64, method).volume_factors
    assert float((factors - math.exp(0.8 * 1.25)).abs().max()) < (0.06 if method == "euler" else 1e-3)


def test_steps_too_long_flip():
    field = spiral(0.0, -3.0)  # x ↦ (1 − 3h) x
    assert inspect_paths(field, POINTS, 4).n_flips == 0
    # In the plane both axes turn round and the determinant is positive again; on a line it is not.
    assert inspect_paths(field, POINTS, 2).n_flips == 0

    def along_x(time, points):
        return -3 * points * torch.tensor([1.0, 0.0], dtype=points.dtype)

    report = inspect_paths(along_x, POINTS, 2)
    assert report.n_flips == 2 * len(POINTS)
    assert report.safe_steps == 4


@pytest.mark.parametrize(("lipschitz", "share", "steps"), [(0.0, 1, 1), (3.0, 1, 4), (2.9, 1, 3), (3.0, 0.5, 7)])
def test_steps_below(lipschitz, share, steps):
    assert steps_below(lipschitz, share) == steps
    assert lipschitz / steps < share
    assert steps == 1 or lipschitz / (steps - 1) >= share


def test_doors():
    for arguments, words in (((math.inf,), "no step"), ((-1.0,), "no step"), ((1.0, 0.0), "share is 0.0")):
        refuses(words, steps_below, *arguments)
    refuses("gap is 0", tip_over_face, 0.0)
    refuses(r"strength is 1\.0", crossing_time, 0.3, Push(1.0, 0.3))


def test_a_diffeomorphism_of_points_lets_triangles_cross():
    field = Push(-1.0, 0.3)
    assert crossings_along(field, PAIR, 10) == [0, 0, 0, 0, *[2] * 7]
    report = inspect_paths(field, PAIR.vertices, 10)
    assert report.n_flips == 0
    np.testing.assert_allclose(report.determinants, 1)
    assert float(field.lipschitz_bound()) / 10 < 1


@pytest.mark.parametrize(("gap", "strength", "width"), [(0.3, -1.0, 0.3), (0.5, -0.9, 0.5)])
def test_the_moment_of_crossing(gap, strength, width):
    pair, field = tip_over_face(gap), Push(strength, width)
    moment = crossing_time(gap, field)
    for time, n_faces in ((moment - 1e-9, 0), (moment + 1e-9, 2)):
        assert len(self_intersecting_faces(pair.with_vertices(field.flow(pair.vertices, 0.0, time)))) == n_faces


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
    assert found.n_crossing == crossings(crossed) > 0
    assert crossings(found.mesh) == 0
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
    assert crossings(found.mesh) == 0
    equator = (BALL.vertices[:, 2].abs() < 1).nonzero()[:, 0]
    torch.testing.assert_close(found.mesh.vertices[equator], carried.vertices[equator])
    assert float((found.mesh.vertices - BALL.vertices).norm(dim=1).max()) > 0.5


def test_more_than_the_largest_share_is_not_smoothed_alone():
    """The same defect goes back when fewer faces may cross, and is smoothed away when as many may."""
    crossed = with_an_edge_turned()
    share = crossings(crossed) / len(BALL.faces)
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
    assert crossings(found.mesh) == 0
    assert torch.equal(found.mesh.vertices, initial.vertices)


def test_doors_of_repair():
    refuses("other faces", repair_crossings, BALL, icosphere(3, 10.0))
    refuses("max_backtracks is 0", repair_crossings, BALL, BALL, 0)
    refuses("max_rounds is 0", repair_crossings, BALL, BALL, max_rounds=0)
    for share in (0, 1.5, float("nan")):
        refuses("largest_share is", repair_crossings, BALL, BALL, largest_share=share)
    crossed = BALL.with_vertices(with_pole_pushed_through(25.0))
    refuses("initial surface has self-intersecting faces", repair_crossings, crossed, crossed)


# An inner and an outer surface that cross nowhere.


def test_surfaces_that_are_nested_stay_as_they_are():
    inner = icosphere(3, 10.0)
    outer = inner.with_vertices(1.2 * inner.vertices + torch.tensor([0.3, 0.0, 0.0]))
    first, second = nest_surfaces(inner, outer)
    assert torch.equal(first.vertices, inner.vertices)
    torch.testing.assert_close(second.vertices, outer.vertices, atol=1e-12, rtol=0)


def test_an_outer_surface_within_the_inner_one_stops_at_the_gap():
    inner = icosphere(4, 10.0)
    dented = torch.where(inner.vertices[:, 2:] > 8, 0.9, 1.2)
    first, second = nest_surfaces(inner, inner.with_vertices(dented * inner.vertices), gap=0.1)
    assert crossings(first, second) == 0
    assert torch.equal(first.vertices, inner.vertices)
    radii = second.vertices.norm(dim=1)
    assert float(radii.min()) == pytest.approx(10.1, abs=0.01)
    away = inner.vertices[:, 2] < 7
    torch.testing.assert_close(radii[away], torch.full_like(radii[away], 12.0))


def test_banks_that_would_pass_through_each_other_stop_before():
    """Two balls 1 apart, whose outer surfaces would overlap by 1."""
    left = icosphere(4, 5.0)
    right = left.with_vertices(left.vertices + torch.tensor([11.0, 0.0, 0.0]))
    inner = united([left, right])
    grown = torch.cat([left.vertices * 1.2, right.vertices + 0.2 * left.vertices])
    outer = inner.with_vertices(grown)
    assert crossings(outer) > 0
    first, second = nest_surfaces(inner, outer)
    assert crossings(first, second) == 0
    n = len(left.vertices)
    assert float(second.vertices[:n, 0].max()) < float(second.vertices[n:, 0].min())
    behind = left.vertices[:, 0] < 0
    torch.testing.assert_close(second.vertices[:n][behind], grown[:n][behind], atol=1e-12, rtol=0)


def crumpled_ball(size: float) -> Mesh:
    """A ball with noise at the top, and then without faces that intersect."""
    ball = icosphere(4, 10.0)
    vertices = ball.vertices.clone()
    noisy = vertices[:, 2] > 8
    vertices[noisy] += size * torch.from_numpy(np.random.default_rng(0).normal(size=(int(noisy.sum()), 3)))
    return smooth_crossings(ball.with_vertices(vertices))


def test_the_copy_finds_the_outer_side_of_creases(monkeypatch):
    crumpled = crumpled_ball(0.3)
    outer = crumpled.with_vertices(1.2 * crumpled.vertices)
    first, second = nest_surfaces(crumpled, outer)
    assert torch.equal(first.vertices, crumpled.vertices)
    assert crossings(first, second) == 0
    # A copy along the normals would cross the surface, and both would be smoothed.
    copy = crumpled.with_vertices(crumpled.vertices + 0.05 * vertex_normals(crumpled))
    assert crossings(crumpled, copy) > 0
    monkeypatch.setattr("meshot.flow.crossings.outward_directions", normals_alone)
    assert not torch.equal(nest_surfaces(crumpled, outer)[0].vertices, crumpled.vertices)


def test_creases_without_an_outer_side_are_smoothed():
    crumpled = crumpled_ball(0.8)
    hidden = outward_directions(crumpled)[1] <= 0
    assert 0 < int(hidden.sum()) < 20
    first, second = nest_surfaces(crumpled, crumpled.with_vertices(1.2 * crumpled.vertices))
    assert crossings(first, second) == 0
    still = crumpled.vertices[:, 2] < 6
    assert torch.equal(first.vertices[still], crumpled.vertices[still])
    moved = (first.vertices - crumpled.vertices).norm(dim=1)
    assert bool((moved > 0).sum() < 3 * hidden.sum())
    assert 0 < float(moved.max()) < 1.5
    assert float((second.vertices.norm(dim=1) - 12).abs().median()) < 0.05


def normals_alone(mesh: Mesh) -> tuple[torch.Tensor, torch.Tensor]:
    """The normals of the vertices, as if each lay outside of all faces."""
    return vertex_normals(mesh), torch.ones(len(mesh.vertices))


def test_the_gap_is_narrower_where_two_parts_are_nearer():
    """Two balls .04 apart: copies .05 outside would meet."""
    ball = icosphere(4, 5.0)
    inner = united([ball, ball.with_vertices(ball.vertices + torch.tensor([10.04, 0.0, 0.0]))])
    outer = inner.with_vertices(inner.vertices + 0.2 * ball.vertices.repeat(2, 1))
    first, second = nest_surfaces(inner, outer)
    assert torch.equal(first.vertices, inner.vertices)
    assert crossings(first, second) == 0
    gaps = (second.vertices - first.vertices).norm(dim=1)
    assert 0.003 < float(gaps.min()) < 0.02
    assert float(gaps.max()) == pytest.approx(1.0)


def wedge() -> Mesh:
    """A closed wedge with a ridge of 30°, whose faces on the right are ten times as large as those on the left."""
    s, c = math.sin(math.pi / 12), math.cos(math.pi / 12)
    corners = [[0, 0, 0], [0, 1, 0], [10 * s, 0, -10 * c], [0, -1, 0], [-s, 0, -c]]
    faces = [[0, 3, 2], [0, 2, 1], [0, 1, 4], [0, 4, 3], [2, 3, 4], [4, 1, 2]]
    return Mesh(torch.tensor(corners, dtype=torch.float64), torch.tensor(faces))


def test_directions_point_outside_of_all_faces_around():
    """The normal in the middle of the ridge, a mean by area, lies behind the faces on the left."""
    mesh = wedge()
    around = face_normals(mesh)[:4]
    assert float((around @ vertex_normals(mesh)[0]).min()) < -0.5
    directions, least = outward_directions(mesh)
    torch.testing.assert_close(directions.norm(dim=1), torch.ones(5, dtype=torch.float64))
    assert float((around @ directions[0]).min()) >= 0.1
    assert float((around @ directions[0]).min()) == pytest.approx(float(least[0]))
    flat = icosphere(2)
    torch.testing.assert_close(outward_directions(flat)[0], vertex_normals(flat))


def best_direction(normals: torch.Tensor) -> float:
    """The largest least cosine of a unit vector to these normals, by a general solver; 0 if none is outside of all.

    With v·n ≥ 1 for all normals, the shortest v has the length 1/cosine.
    """
    found = minimize(
        lambda v: v @ v, normals.mean(dim=0).numpy(), jac=lambda v: 2 * v,
        constraints={"type": "ineq", "fun": lambda v: normals.numpy() @ v - 1, "jac": lambda v: normals.numpy()},
        options={"maxiter": 500},
    )  # fmt: skip
    return 1 / float(np.linalg.norm(found.x)) if found.success else 0.0


def test_no_direction_is_farther_outside_than_the_one_that_is_found():
    """Vertices of a sphere with noise, against SLSQP of SciPy."""
    ball = icosphere(3)
    noise = torch.from_numpy(np.random.default_rng(0).normal(size=ball.vertices.shape))
    mesh = ball.with_vertices(ball.vertices + 0.07 * noise)
    _, least = outward_directions(mesh)
    normals = face_normals(mesh)
    best = torch.tensor([best_direction(normals[(mesh.faces == k).any(dim=1)]) for k in range(len(ball.vertices))])
    poor = least < 0.1
    assert poor.sum() > 20
    # Those that are far enough outside are not improved; others are found, but for the last ones near 0.
    assert bool((least <= best + 1e-6)[best > 0].all())
    torch.testing.assert_close(least[poor & (best > 0.03)], best[poor & (best > 0.03)].double(), atol=0.03, rtol=0)
    assert bool((least[best > 0.1] >= 0.09).all())
    assert bool((least[best == 0] <= 0).all())
    assert 0 < int((best == 0).sum()) < len(best)


def test_an_outer_surface_that_crosses_itself_is_smoothed_first():
    """The ends of some edges are exchanged. Their vertices would stop on the way."""
    inner = icosphere(4, 10.0)
    ends = inner.faces[::500, :2]
    grown = 1.2 * inner.vertices
    grown[ends] = grown[ends].flip(1)
    outer = inner.with_vertices(grown)
    assert crossings(outer) > 0
    first, second = nest_surfaces(inner, outer)
    assert crossings(first, second) == 0
    torch.testing.assert_close(second.vertices, smooth_crossings(outer, 60).vertices, atol=1e-12, rtol=0)


def test_surfaces_that_cannot_be_nested_are_refused():
    inner = icosphere(2, 1.0)
    refuses("other faces", nest_surfaces, inner, Mesh(inner.vertices, inner.faces.flip(1)))
    refuses("gap", nest_surfaces, inner, inner, gap=0.0)
    refuses("n_steps", nest_surfaces, inner, inner, n_steps=0)
    same = united([inner, inner.with_vertices(inner.vertices + 0.5)])
    refuses("still cross after 1 rounds", nest_surfaces, same, same, max_rounds=1)
