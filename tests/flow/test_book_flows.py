"""Flows of the book: analytic ones and networks, chains, standstills, descents and forces."""

import math

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from meshot.flow.crossings import inspect_paths, sampled_lipschitz
from meshot.flow.fields import GridVelocity, grid_around
from meshot.flow.integration import integrate, trajectory
from meshot.loss.directions import quasi_directions
from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.transport import chamfer
from meshot.measure.discrete import DiscreteMeasure
from meshot.mesh import united
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.editing import with_edges_split
from meshot.mesh.geometry import mesh_edges
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot_book import flows as damping
from meshot_book.examples.unsteady import Accelerated, Drifting, RootSink
from meshot_book.flows import (
    Affine,
    Leg,
    NetworkVelocity,
    Push,
    Vortex,
    chain_end,
    chain_reports,
    chain_trajectory,
    damped,
    descend,
    forces,
    probe_forces,
    rotation,
    shear,
    spiral,
    without_crossings,
)
from refusals import refuses

DRIFT = torch.tensor([0.7, -0.4], dtype=torch.float64)
FIELDS = {
    "rotation": rotation(1.3),
    "spiral": spiral(-2.0, 0.5),
    "shear": shear(1.5),
    "affine": Affine(torch.tensor([[0.2, 1.0], [-0.3, -0.6]]).double(), DRIFT),
    "vortex": Vortex(2.5, 0.8),
    "push": Push(-1.2, 0.5),
    "accelerated vortex": Accelerated(Vortex(2.0, 0.8), -1.7),
    "drifting vortex": Drifting(Vortex(2.0, 0.8), DRIFT),
}
POINTS = torch.from_numpy(np.random.default_rng(0).uniform(-1.5, 1.5, (8, 2)))
ONES = torch.ones(2, 2)


def solved(field, points, start, end):
    """Another library's answer, to ten digits."""

    def velocity(time, flat):
        at = torch.tensor(time, dtype=torch.float64)
        return field(at, torch.from_numpy(flat.reshape(points.shape))).numpy().ravel()

    found = solve_ivp(velocity, (start, end), points.numpy().ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    return torch.from_numpy(found.y[:, -1].reshape(points.shape))


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (1.0, 0.0), (0.3, 0.8)])
def test_flow_solves_the_equation(name, start, end):
    field = FIELDS[name]
    torch.testing.assert_close(field.flow(POINTS, start, end), solved(field, POINTS, start, end), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", FIELDS)
def test_the_constant_is_reached_and_not_passed(name):
    field, bound = FIELDS[name], float(FIELDS[name].lipschitz_bound())
    axis = torch.linspace(-2, 2, 81, dtype=torch.float64)
    seen = float(sampled_lipschitz(field, torch.cartesian_prod(axis, axis), n_times=40))
    assert field.is_lipschitz
    assert 0.97 * bound < seen < bound * (1 + 1e-9)


@pytest.mark.parametrize("field", [Vortex(2.0, 0.8), Push(1.0, 0.5)])
def test_in_space_as_in_the_plane(field):
    points = torch.cat([POINTS, 0 * POINTS[:, :1]], dim=1)
    moved = field.flow(points)
    torch.testing.assert_close(moved[:, :2], field.flow(POINTS))
    assert not moved[:, 2].any()
    torch.testing.assert_close(moved, solved(field, points, 0.0, 1.0), rtol=1e-8, atol=1e-8)
    away = field.flow(points + torch.tensor([0.0, 0.0, 5.0], dtype=torch.float64))
    assert float((away - points)[:, :2].abs().max()) < 1e-9 or isinstance(field, Vortex)


def test_root_sink_is_not_lipschitz_and_its_points_meet():
    field, points = RootSink(), torch.tensor([[0.04], [-0.09], [4.0]], dtype=torch.float64)
    assert not field.is_lipschitz
    assert float(field.lipschitz_bound()) == math.inf
    torch.testing.assert_close(field.flow(points, 0.0, 0.15), solved(field, points, 0.0, 0.15), rtol=1e-7, atol=1e-7)
    assert torch.equal(field.flow(points)[:2], torch.zeros(2, 1).double())
    assert float(sampled_lipschitz(field, points * 1e-8)) > 1e3
    refuses("no inverse", field.flow, points, 1.0, 0.0)


def test_dtype_follows_the_points():
    for field in FIELDS.values():
        assert field.flow(POINTS.float()).dtype == torch.float32
        assert field(torch.tensor(0.5), POINTS.float()).dtype == torch.float32


NETWORK_POINTS = torch.from_numpy(np.random.default_rng(0).normal(size=(300, 2)))


def by_hand(field, time, points):
    values = points.numpy() / field.extent
    if field.with_time:
        values = np.concatenate([values, np.full((len(values), 1), time)], axis=1)
    layers = [(w.detach().numpy(), b.detach().numpy()) for w, b in zip(field.weights, field.biases, strict=True)]
    for weight, bias in layers[:-1]:
        values = np.tanh(values @ weight.T + bias)
    return values @ layers[-1][0].T + layers[-1][1]


@pytest.mark.parametrize("with_time", [True, False])
def test_is_the_formula(with_time):
    field = NetworkVelocity(2, 16, 2, generator=3, extent=2.0, last_scale=1.0, with_time=with_time)
    found = field(torch.tensor(0.3, dtype=torch.float64), NETWORK_POINTS).detach()
    np.testing.assert_allclose(found, by_hand(field, 0.3, NETWORK_POINTS), rtol=1e-12, atol=1e-14)
    later = field(torch.tensor(0.9, dtype=torch.float64), NETWORK_POINTS).detach()
    assert torch.equal(found, later) is not with_time


def test_starts_at_rest():
    assert torch.equal(integrate(NetworkVelocity(2), NETWORK_POINTS).detach(), NETWORK_POINTS)


@pytest.mark.parametrize("n_layers", [1, 2, 3])
def test_bound_holds_and_the_estimate_is_below_it(n_layers):
    field = NetworkVelocity(2, 16, n_layers, generator=1, extent=0.5, last_scale=1.0)
    bound, seen = float(field.lipschitz_bound()), float(sampled_lipschitz(field, NETWORK_POINTS))
    assert 0 < seen <= bound
    values = field(torch.tensor(0.2).double(), NETWORK_POINTS).detach()
    slopes = torch.pdist(values) / torch.pdist(NETWORK_POINTS)
    assert float(slopes.max()) <= bound
    assert field.is_lipschitz


def test_bound_of_a_single_unit_is_its_slope():
    field = NetworkVelocity(1, 1, 1, extent=2.0, last_scale=1.0)
    with torch.no_grad():
        field.weights[0].copy_(torch.tensor([[3.0, 100.0]]))  # the time may vary as it likes
        field.weights[1].copy_(torch.tensor([[-4.0]]))
        field.biases[0].zero_()
    assert float(field.lipschitz_bound()) == pytest.approx(3 * 4 / 2)


@pytest.mark.parametrize("gradient", ["direct", "adjoint"])
def test_parameters_have_gradients(gradient):
    field = NetworkVelocity(2, 8, 1, last_scale=1.0)
    integrate(field, NETWORK_POINTS, 4, gradient=gradient).square().sum().backward()
    assert all(p.grad is not None and bool(p.grad.any()) for p in field.parameters())


def test_seeds():
    weights = [NetworkVelocity(2, generator=seed).weights[0].detach() for seed in (0, 0, 1)]
    assert torch.equal(weights[0], weights[1])
    assert not torch.equal(weights[0], weights[2])


CHAIN_POINTS = torch.tensor([[1.0, 2.0], [-0.5, 0.3], [0.0, -1.0]], dtype=torch.float64)


def test_the_first_leg_comes_first():
    first, second = shear(0.7), rotation(0.9)
    expected = second.flow(first.flow(CHAIN_POINTS))
    assert float((first.flow(second.flow(CHAIN_POINTS)) - expected).abs().max()) > 0.1
    # One Euler step of a shear is exact; a rotation by RK4 errs by less than 1e-9 in 64 steps.
    legs = [Leg(first, 1), Leg(second, 64, "rk4")]
    torch.testing.assert_close(chain_end(legs, CHAIN_POINTS), expected, atol=1e-9, rtol=0)


def test_no_leg_moves_nothing():
    assert torch.equal(chain_end([], CHAIN_POINTS), CHAIN_POINTS)
    assert torch.equal(chain_trajectory([], CHAIN_POINTS), CHAIN_POINTS[None])
    assert chain_reports([], CHAIN_POINTS) == []


def test_the_trajectory_passes_every_step_once():
    legs = [Leg(rotation(0.5), 3), Leg(shear(1.0), 2, "midpoint"), Leg(rotation(-1.0), 4, "rk4")]
    positions = chain_trajectory(legs, CHAIN_POINTS)
    assert positions.shape == (1 + 3 + 2 + 4, 3, 2)
    assert torch.equal(positions[0], CHAIN_POINTS)
    assert torch.equal(positions[-1], chain_end(legs, CHAIN_POINTS))
    assert torch.equal(positions[:4], trajectory(legs[0].field, CHAIN_POINTS, 3))
    middle = integrate(legs[0].field, CHAIN_POINTS, 3)
    assert torch.equal(positions[3:6], trajectory(legs[1].field, middle, 2, "midpoint"))


def test_reports_begin_where_the_leg_before_ended():
    # What the second leg meets depends on where the first one took the points.
    matrix = torch.diag(torch.tensor([0.0, 0.4], dtype=torch.float64))
    legs = [Leg(shear(2.0), 2), Leg(Affine(matrix), 3)]
    first, second = chain_reports(legs, CHAIN_POINTS)
    middle = integrate(legs[0].field, CHAIN_POINTS, 2)
    assert torch.equal(second.positions, inspect_paths(legs[1].field, middle, 3).positions)
    assert torch.equal(second.positions[-1], chain_end(legs, CHAIN_POINTS))
    assert first.steepest == pytest.approx(2.0)
    assert second.steepest == pytest.approx(0.4)
    torch.testing.assert_close(second.volume_factors, torch.full((3,), (1 + 0.4 / 3) ** 3).double())


def test_gradients_go_through_all_legs():
    points = CHAIN_POINTS.clone().requires_grad_()
    legs = [Leg(shear(0.7), 1), Leg(shear(-0.2), 1)]
    torch.autograd.gradcheck(lambda x: chain_end(legs, x), points)
    (gradient,) = torch.autograd.grad(chain_end(legs, points)[:, 0].sum(), points)
    torch.testing.assert_close(gradient, torch.tensor([[1.0, 0.5]] * 3).double())


def uniform(interpolation: str = "cubic") -> GridVelocity:
    """Everything goes 1 mm along x in unit time; two levels and two pieces of time."""
    field = GridVelocity(
        torch.full((3,), -20.0).double(), torch.full((3,), 20.0).double(), (4.0, 2.0), 2, interpolation
    )
    with torch.no_grad():
        field.levels[0][..., 0] = 0.75
        field.levels[1][..., 0] = 0.25
    return field


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_still_near_places_and_as_before_away_from_them(interpolation):
    field, place = uniform(interpolation), torch.tensor([[3.0, -1.0, 2.0]]).double()
    calm = damped(field, place, 8.0)
    generator = torch.Generator().manual_seed(0)
    points = 40 * torch.rand(4000, 3, generator=generator, dtype=torch.float64) - 20
    points[:100] = place + points[:100] / 40  # at most .9 mm away
    away = (points - place).norm(dim=1)
    reach = 2 * 3**0.5 * 2  # half of the 4 × 4 × 4 nodes around a point, at 2 mm
    for time in (0.1, 0.9):
        before, after = (f(torch.tensor(time), points).detach() for f in (field, calm))
        torch.testing.assert_close(before, torch.eye(3)[0].double().expand(4000, 3))
        assert float(after[away < 8.0 - reach].abs().max()) == 0
        torch.testing.assert_close(after[away > 16.0 + reach], before[away > 16.0 + reach])
        assert float(after[:, 0].min()) >= 0
        assert float(after[:, 0].max()) <= 1 + 1e-12
    # A ramp of 8 mm: an eighth per mm along the ray, and little more for what the grid adds.
    assert 0.05 < float(calm.lipschitz_bound().detach()) < 0.3
    assert field.levels[0].tolist()[0][0][0][0][0] == 0.75


def plates() -> Mesh:
    """Two parallel plates, 2 mm apart, each of 512 triangles 1 mm long."""
    square = Mesh(
        torch.tensor([[-8.0, -8, 0], [8, -8, 0], [8, 8, 0], [-8, 8, 0]]).double(), torch.tensor([[0, 1, 2], [0, 2, 3]])
    )
    for _ in range(4):
        square = with_edges_split(square, mesh_edges(square))
    up = torch.tensor([0.0, 0.0, 2.0]).double()
    return united([square, square.with_vertices(square.vertices + up)])


def crossing_field(mesh: Mesh) -> GridVelocity:
    """Noise of a length that the triangles cannot follow."""
    field = grid_around(mesh.vertices, margin=4.3, spacings=(1.0,), n_pieces=1)  # no node at a vertex
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        field.levels[0].normal_(0, 0.3, generator=generator)
        middle = field.levels[0].shape[1] // 2
        field.levels[0][:, middle - 2 : middle + 2, middle - 2 : middle + 2] *= 15
    return field


def test_crossings_go_and_the_rest_still_moves():
    mesh = plates()
    field = crossing_field(mesh)
    before = mesh.with_vertices(integrate(field, mesh.vertices, 4).detach())
    assert len(self_intersecting_faces(mesh)) == 0
    assert len(self_intersecting_faces(before)) > 10
    calm = without_crossings(field, mesh, 4, radius=1.5)
    after = mesh.with_vertices(integrate(calm, mesh.vertices, 4).detach())
    assert len(self_intersecting_faces(after)) == 0
    same = (after.vertices - before.vertices).norm(dim=1) < 1e-9
    assert float(same.double().mean()) > 0.3
    moved = (after.vertices - mesh.vertices).norm(dim=1)
    assert float((moved > 0.01).double().mean()) > 0.5


def test_a_field_without_fault_is_returned_as_it_is():
    field = uniform()
    assert without_crossings(field, icosphere(2, 5.0), 4) is field


def test_the_radius_grows_after_every_third_round(monkeypatch):
    radii = []
    monkeypatch.setattr(damping, "damped", lambda field, places, radius: radii.append(radius) or field)
    mesh = plates()
    with pytest.raises(ValueError, match="still cross after 7 rounds"):
        without_crossings(crossing_field(mesh), mesh, 4, radius=1.5, max_rounds=7)
    assert radii == [1.5, 1.5, 1.5, 3.0, 3.0, 3.0, 4.5]


def test_doors_of_damping(unchecked):
    field, mesh = uniform(), plates()
    refuses("radius", damped, field, mesh.vertices, 0.0)
    refuses("places", damped, field, mesh.vertices[:, :2], 1.0)
    refuses("max_rounds", without_crossings, field, mesh, max_rounds=0)
    leaning = mesh.vertices.clone()
    n_lower = len(leaning) // 2
    leaning[:n_lower, 2] += 0.93 * leaning[:n_lower, 0]  # the lower plate, tilted through the upper
    crossed = mesh.with_vertices(leaning)
    refuses("before the flow", without_crossings, field, crossed)
    refuses("cross after 1 rounds", without_crossings, crossing_field(mesh), mesh, 4, radius=0.01, max_rounds=1)


def quadratic(curvature):
    return lambda points: curvature / 2 * points.square().sum()


def heavy_ball(x, curvature, n_steps, rate, momentum):
    v, path = np.zeros_like(x), [x]
    for _ in range(n_steps):
        v = momentum * v + curvature * path[-1]
        path.append(path[-1] - rate * v)
    return np.array(path)


def test_path_is_the_recursion():
    start = np.random.default_rng(0).normal(size=(5, 2))
    run = descend(quadratic(0.7), torch.from_numpy(start), 30, learning_rate=0.5, momentum=0.8, keep=range(31))
    path = heavy_ball(start, 0.7, 30, 0.5, 0.8)
    np.testing.assert_allclose(run.snapshots.numpy(), path, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(run.losses.numpy(), 0.35 * np.square(path[:-1]).sum(axis=(1, 2)), rtol=1e-12)


@pytest.mark.parametrize("momentum", [0.0, 0.5, 0.9])
@pytest.mark.parametrize(("factor", "grows"), [(0.98, False), (1.02, True)])
def test_stability_bound(momentum, factor, grows):
    curvature = 3.0
    rate = factor * 2 * (1 + momentum) / curvature
    end = descend(quadratic(curvature), torch.ones(1, 2, dtype=torch.float64), 2000, rate, momentum).points
    assert bool(end.abs().max() > 1e3) is grows
    assert bool(end.abs().max() < 1e-3) is not grows


def test_keeps_what_was_asked_for_and_leaves_the_start_alone():
    start = torch.ones(3, 2)
    run = descend(quadratic(1.0), start, 4, 0.1, keep=(2, 0))
    assert run.steps == (0, 2, 4)
    assert run.snapshots.shape == (3, 3, 2)
    assert run.snapshots.dtype == torch.float32
    assert torch.equal(run.at(0), start)
    assert torch.equal(run.points, run.at(4))
    assert torch.equal(start, torch.ones(3, 2))
    assert not run.points.requires_grad
    assert descend(quadratic(1.0), start, 2).steps == (2,)


def test_the_loss_is_called_once_a_step():
    seen = []

    def loss(points):
        seen.append(1)
        return points.sum()

    descend(loss, torch.zeros(2, 2), 7)
    assert len(seen) == 7


@pytest.fixture
def clouds():
    generator = np.random.default_rng(0)
    return [torch.from_numpy(generator.normal(size=(n, 2))) for n in (6, 9)]


def chamfer_arrows(points, target):
    """Slow twin: to the nearest target, and to every target that calls."""
    distances = torch.cdist(points, target)
    arrows = []
    for i in range(len(points)):
        arrow = target[distances[i].argmin()] - points[i]
        for j in range(len(target)):
            if int(distances[:, j].argmin()) == i:
                arrow = arrow + len(points) / len(target) * (target[j] - points[i])
        arrows.append(arrow)
    return torch.stack(arrows)


def test_chamfer_forces_are_the_two_sums(clouds):
    points, target = clouds
    found = forces(lambda x: chamfer(DiscreteMeasure(x), DiscreteMeasure(target)), points)
    torch.testing.assert_close(found, chamfer_arrows(points, target), rtol=1e-12, atol=1e-12)


def test_sliced_force_towards_a_translated_copy_is_half_the_way(clouds):
    points, shift = clouds[0], torch.tensor([0.3, -0.7], dtype=torch.float64)
    target = DiscreteMeasure(points + shift)
    found = forces(lambda x: sliced_wasserstein(DiscreteMeasure(x), target, quasi_directions(8, 2)), points)
    # The mean of θθᵀ over equal angles is exactly I/2.
    torch.testing.assert_close(found, (shift / 2).expand(6, 2), rtol=1e-12, atol=1e-12)


def test_probe_feels_what_a_further_point_would(clouds):
    points, target = clouds
    probes = torch.tensor([[0.1, 0.2], [3.0, 0.0]], dtype=torch.float64)
    found = probe_forces(lambda x: chamfer(DiscreteMeasure(x), DiscreteMeasure(target)), points, probes)
    wanted = [chamfer_arrows(torch.cat([points, probe[None]]), target)[-1] for probe in probes]
    torch.testing.assert_close(found, torch.stack(wanted), rtol=1e-12, atol=1e-12)


def descends(points=ONES, **settings):
    return descend(quadratic(1e10), points, **{"n_steps": 10} | settings)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Affine(torch.zeros(2, 3)), r"\(d, d\) is needed"),
        (lambda: Affine(torch.zeros(2, 2), torch.zeros(3)), r"\(2,\) is needed"),
        (lambda: Vortex(1.0, 0.0), "radius is 0.0"),
        (lambda: Push(1.0, -1.0), "width is -1.0"),
        (lambda: Drifting(Vortex(1.0), torch.tensor([math.nan, 0.0])), "NaN"),
        (lambda: NetworkVelocity(0), "n_dimensions is 0"),
        (lambda: NetworkVelocity(2, width=0), "width is 0"),
        (lambda: NetworkVelocity(2, n_layers=0), "n_layers is 0"),
        (lambda: NetworkVelocity(2, extent=0.0), "extent is 0"),
        (lambda: chain_end([Leg(shear(1.0), 0)], ONES), "n_steps"),
        (lambda: descends(learning_rate=0.0), "learning_rate"),
        (lambda: descends(momentum=1.0), "momentum"),
        (lambda: descends(momentum=-0.1), "momentum"),
        (lambda: descends(keep=(11,)), "keep asks"),
        (lambda: descends(keep=(-1,)), "keep asks"),
        (lambda: descends(n_steps=0), "n_steps"),
        (lambda: descends(learning_rate=1e30), "smaller learning_rate"),
        (lambda: descends(ONES.long()), "floating point"),
        (lambda: descends(ONES[0]), "shape"),
        (lambda: descend(quadratic(1.0), ONES, 3).at(1), "kept only after"),
        (lambda: forces(torch.sum, ONES.long()), "floating point"),
        (lambda: forces(torch.sum, ONES[0]), "shape"),
    ],
)
def test_doors(unchecked, make, words):
    refuses(words, make)
