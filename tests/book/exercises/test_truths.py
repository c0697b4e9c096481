"""The solutions that the checkers know agree with other libraries, with the package, or with brute force."""

import math

import numpy as np
import ot
import pytest
import scipy.spatial
import skimage.measure
import torch
from scipy import optimize, stats
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from meshot import DiscreteMeasure, Mesh, empirical, sinkhorn_divergence, slice_costs, varifold, wasserstein
from meshot.flow import integrate, steps_below
from meshot.loss import chamfer, sliced_partial, sliced_unbalanced, sliced_wasserstein
from meshot.mesh import (
    Contour,
    circle,
    euler_number,
    face_areas,
    folded_sphere,
    self_intersecting_faces,
    signed_volume,
    vertex_areas,
)
from meshot.metrics import average_surface_distance, edge_length_variation, hausdorff_distance
from meshot.metrics.distances import Offsets
from meshot.model import DeformationNetwork
from meshot.model.deformation import CubeConvolution
from meshot.volume import Volume, centre_ras, place_on_grid
from meshot.volume.registration import EXTENT_MM, SHAPE
from meshot_book.exercises import drawn_curves
from meshot_book.exercises.check import EXERCISES
from meshot_book.flows import forces
from meshot_book.statistics import intraclass_correlation

LINE = torch.ones(1, 1, dtype=torch.float64)


def truth(name):
    return EXERCISES[name].exercise().truth


def quantiles(x, a, z):
    """By counting: no sorting of masses, no searching."""
    below = [float(a[x <= place].sum()) for place in x]
    return torch.stack([min(p for p, m in zip(x, below) if m >= level - 1e-12) for level in z.tolist()])


def weight_gradient(x, a, y, b, p):
    """The dual variables of the linear program."""
    _, log = ot.emd(a.numpy(), b.numpy(), np.abs(x.numpy()[:, None] - y.numpy()) ** p, log=True)
    dual = torch.from_numpy(log["u"])
    return dual - a @ dual


def largest_rate(n_selections, momentum):
    """Bisection on a heavy ball that is let go: no formula."""

    def growth(rate):
        matrix = np.array([[1 + momentum - rate * 2 * (1 + n_selections), -momentum], [1, 0]])
        return np.abs(np.linalg.eigvals(matrix)).max() - 1 - 1e-9

    low, high = 0.0, 8.0
    for _ in range(60):
        rate = (low + high) / 2
        low, high = (rate, high) if growth(rate) <= 0 else (low, rate)
    return low


def tent_density(c, x):
    low, middle, high = np.sort(c.numpy())
    return stats.triang.pdf(x.numpy(), (middle - low) / (high - low), low, high - low)


def mean_square(v, f, u):
    """The rule of the three mid-edge points, exact for quadratics."""
    corners, areas = v[f] @ u, face_areas(Mesh(v, f))
    middles = (corners + corners.roll(1, dims=1)) / 2
    return (areas * middles.square().mean(dim=1)).sum() / areas.sum()


def blocked_chamfer(points, targets, distances, limit):
    for one in points:
        distances(one[None], targets)
    there, _ = scipy.spatial.KDTree(targets).query(points)
    back, _ = scipy.spatial.KDTree(points).query(targets)
    return (there**2).mean() + (back**2).mean()


def centred_cost(source, target, directions):
    t = target.mean(dim=0) - source.mean(dim=0)
    costs = slice_costs(DiscreteMeasure(source + t), DiscreteMeasure(target), directions, 2)
    return (t @ t) / len(t) + costs.mean()


def area_gradient(a, b, c):
    corner = a.clone().requires_grad_()
    return torch.autograd.grad(torch.linalg.cross(b - corner, c - corner).norm() / 2, corner)[0]


def undo_step(velocity, images, step):
    """By another library's root finder."""

    def residual(flat):
        x = torch.from_numpy(flat.reshape(images.shape))
        return (x + step * velocity(x) - images).numpy().ravel()

    return optimize.fsolve(residual, images.numpy().ravel(), xtol=1e-13).reshape(images.shape)


def pieces_needed(length, bend, gap):
    """By trying: the chord of an arc y = bend x² / 2 of each length."""
    return next(n for n in range(1, 10_000) if bend / 2 * (length / n / 2) ** 2 <= gap)


def equal_time(times, values, other_times, other_values):
    moment = min(float(times[-1]), float(other_times[-1]))
    return [np.interp(moment, times, values), np.interp(moment, other_times, other_values)]


def pair_costs(gap, reach):
    pair = [DiscreteMeasure(torch.tensor([[float(x)]], dtype=torch.float64)) for x in (0, gap)]
    return [float(loss(*pair, reach, LINE)) for loss in (sliced_partial, sliced_unbalanced)]


def partial_cost(positions, masses, reach):
    """The primal problem: what is transported, for every pair of a positive and a negative mass."""
    here, there = np.flatnonzero(masses > 0), np.flatnonzero(masses < 0)
    costs = np.abs(positions[here][:, None] - positions[there]) - reach
    sums = np.vstack([np.kron(np.eye(len(here)), np.ones(len(there))), np.kron(np.ones(len(here)), np.eye(len(there)))])
    found = optimize.linprog(costs.ravel(), A_ub=sums, b_ub=np.abs(masses[np.concatenate([here, there])]))
    return found.fun + reach / 2 * np.abs(masses).sum()


def feature_at(row, kernel, place):
    """The row along z in the middle of an image of zeros, the kernel likewise."""
    size = len(kernel)
    data = np.zeros((2 * size + 1, 2 * size + 1, len(row)))
    data[size, size] = row.numpy()
    cubes = CubeConvolution(1, 1, size)
    with torch.no_grad():
        cubes.weight.zero_()
        cubes.weight[0, 0, size // 2, size // 2] = kernel
    images = cubes.images(Volume(data, np.eye(4)))
    return cubes.at(cubes.maps(images), torch.tensor([[size, size, place]], dtype=torch.float64))[0, 0]


def two_sided(there, back):
    sides = [Offsets(x.numpy(), np.ones(len(x))) for x in (there, back)]
    return [average_surface_distance(*sides), hausdorff_distance(*sides)]


def through_chain(fields, points, n_steps):
    """RK4 from its Butcher tableau."""
    for field in fields:
        for _ in range(n_steps):
            slopes = []
            for node in (0, 0.5, 0.5, 1):
                slopes.append(field(points + node / n_steps * slopes[-1] if slopes else points))
            points = points + sum(share * slope for share, slope in zip((1, 2, 2, 1), slopes)) / (6 * n_steps)
    return points


def handles(faces):
    vertices = torch.from_numpy(np.random.default_rng(0).normal(size=(int(faces.max()) + 1, 3)))
    return (2 - euler_number(Mesh(vertices, faces))) // 2


def is_simple(mask):
    """Yokoi's connectivity number of an 8-connected object."""
    free = [not mask[p] for p in ((1, 2), (0, 2), (0, 1), (0, 0), (1, 0), (2, 0), (2, 1), (2, 2))]
    return sum(free[k] - free[k] * free[k + 1] * free[(k + 2) % 8] for k in (0, 2, 4, 6)) == 1


def group_size(effect, reliability, power):
    """The smallest n with the power, by the normal distribution of the difference."""

    def reached(n):
        return stats.norm.cdf(effect * math.sqrt(reliability * n / 2) - stats.norm.isf(0.025)) >= power

    return next(n for n in range(1, 100_000) if reached(n))


def who_is_better(ours, other, larger):
    found = stats.ttest_rel(ours.numpy(), other.numpy())
    return 0 if found.pvalue >= 0.05 else (1 if (found.statistic > 0) == larger else -1)


def best_motion(moving, fixed):
    here, there = moving.numpy().mean(axis=0), fixed.numpy().mean(axis=0)
    turn, _ = scipy.spatial.transform.Rotation.align_vectors(fixed.numpy() - there, moving.numpy() - here)
    return np.column_stack([turn.as_matrix(), there - turn.as_matrix() @ here])


def averaged_weights(weights, decay):
    """The average that a training with averaged weights keeps."""
    network = torch.nn.Linear(weights.shape[1], 1, bias=False, dtype=torch.float64)
    average = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(decay))
    for own in weights:
        network.weight.data[0] = own
        average.update_parameters(network)
    return average.module.weight.data[0]


def luck_of_the_best(n, deviation):
    """The smallest of n uniform numbers is 1 − (1 − u)^(1/n) for a uniform u."""
    u = (np.arange(2_000_000) + 0.5) / 2_000_000
    return deviation * stats.norm.ppf(1 - (1 - u) ** (1 / n)).mean()


def forecast(steps, distances, at):
    """The interval from the covariance of the two numbers of the line."""
    x, y, n = np.log(steps.numpy()), np.log(distances.numpy()), len(steps)
    line, covariance = np.polyfit(x - x.mean(), y, 1, cov="unscaled")
    place = np.array([np.log(at) - x.mean(), 1.0])
    rest = ((y - np.polyval(line, x - x.mean())) ** 2).sum() / (n - 2)
    half = stats.t.ppf(0.975, n - 2) * np.sqrt(rest * (1 + place @ covariance @ place))
    return np.exp(place @ line + np.array([0, -half, half]))


def curve_thickness(white, pial, k):
    """Distances to many points on the other curve."""
    parts = torch.linspace(0, 1, 4001).double()[:, None, None]
    ways = ((white[k], pial), (pial[k], white))
    fine = [(point, (chain[:-1] + parts * (chain[1:] - chain[:-1])).reshape(-1, 2)) for point, chain in ways]
    return sum(float((points - point).norm(dim=1).min()) for point, points in fine) / 2


INDEPENDENT = {
    "quantiles": quantiles,
    "transport_cost": lambda x, a, y, b, p: ot.emd2_1d(*(t.numpy() for t in (x, y, a, b)), metric="minkowski", p=p),
    "weight_gradient": weight_gradient,
    "line_arrows": lambda x, y, u: forces(
        lambda z: sliced_wasserstein(DiscreteMeasure(z), DiscreteMeasure(y), u[None]), x
    ),
    "largest_rate": largest_rate,
    "sliced_cost": lambda x, y, u: sliced_wasserstein(DiscreteMeasure(x), DiscreteMeasure(y), u),
    "tent_density": tent_density,
    "mean_square": mean_square,
    "mean_gap": lambda f, m: stats.binom(m, f).expect(lambda k: abs(k / m - f)) if 0 < f < 1 else 0.0,
    "growth_exponent": lambda sizes, seconds: stats.linregress(np.log(sizes), np.log(seconds)).slope,
    "blocked_chamfer": blocked_chamfer,
    "centred_cost": centred_cost,
    "scale_for_share": lambda loss, share: (
        10 ** optimize.brentq(lambda e: 1 - loss(0) / loss(10**e) - share, -6, 6, xtol=1e-13)
    ),
    "area_gradient": area_gradient,
    "is_inside_out": lambda v, f: bool(torch.det(v[f]).sum() < 0),
    "euler_flow": lambda v, x, n: integrate(lambda t, y: v(float(t), y), x, n),
    "undo_step": undo_step,
    "pieces_needed": pieces_needed,
    "edge_variation": lambda v, f: edge_length_variation(Mesh(v, f)),
    "safe_steps": lambda norms: steps_below(float(norms.max())),
    "equal_time": equal_time,
    "pair_costs": pair_costs,
    "partial_cost": partial_cost,
    "mask_euler": lambda mask: skimage.measure.euler_number(np.pad(mask.numpy(), 1), connectivity=3),
    "count_weights": lambda *sizes: DeformationNetwork(*sizes).n_parameters,
    "feature_at": feature_at,
    "two_sided": two_sided,
    "through_chain": through_chain,
    "observed_order": lambda n, errors: -stats.linregress(np.log(n.numpy()), np.log(errors.numpy())).slope,
    "handles": handles,
    "surface_ras": lambda p, a, s: p - p.new_tensor(centre_ras(Volume(np.zeros(s, dtype=bool), a.numpy()))),
    "is_simple": is_simple,
    "mean_by_area": lambda t, v, f: np.average(t.numpy(), weights=vertex_areas(Mesh(v, f)).numpy()),
    "curve_thickness": curve_thickness,
    "pair_reliability": lambda a, b: intraclass_correlation(np.stack([a, b], axis=1)).value,
    "group_size": group_size,
    "same_order": lambda printed, ours: (stats.kendalltau(printed, ours).statistic + 1) / 2,
    "who_is_better": who_is_better,
    "best_motion": best_motion,
    "averaged_weights": averaged_weights,
    "luck_of_the_best": luck_of_the_best,
    "forecast": forecast,
}


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize("name", INDEPENDENT)
def test_an_independent_solution_passes(capsys, name):
    EXERCISES[name](INDEPENDENT[name])
    assert capsys.readouterr().out.startswith("✓")


def test_the_floor_is_that_of_samples():
    folded, generator = folded_sphere(3, 40.0, 6.0), np.random.default_rng(0)
    area = float(face_areas(folded).sum())
    draws = [float(chamfer(empirical(folded, 500, generator), empirical(folded, 4000, generator))) for _ in range(10)]
    assert np.mean(draws) == pytest.approx(truth("chamfer_floor")(area, 500, 4000), rel=0.05)


def test_the_wrong_claim_stands_out_in_every_plot():
    for seed in range(12):
        x, errors, claimed = drawn_curves(seed)
        slopes = [np.polyfit(x.log(), row.log(), 1)[0] for row in errors]
        gaps = np.sort(np.abs(slopes - claimed.numpy()))
        assert gaps[-1] > 0.07 > 0.05 > gaps[-2]


def test_the_displacements_are_those_of_transport():
    places = torch.tensor([0.0, 1.0, 5.0]).double()
    source, target = torch.tensor([1.0, 1.0, 2.0]).double(), torch.tensor([1.0, 2.0, 5.0]).double()
    cost = float((source / source.sum() * truth("mean_displacements")(places, source, target)).sum())
    assert cost == pytest.approx(stats.wasserstein_distance(places, places, source, target))  # all mass goes one way


def test_the_share_of_a_pixel_is_that_of_many_points():
    rng, ticks = np.random.default_rng(0), (np.arange(2000) + 0.5) / 2000 - 0.5
    x, y = np.meshgrid(ticks, ticks)
    for _ in range(20):
        angle, offset = rng.uniform(0, 2 * np.pi), rng.uniform(-0.8, 0.8)
        counted = (np.cos(angle) * x + np.sin(angle) * y <= offset).mean()
        normal = torch.tensor([np.cos(angle), np.sin(angle)])
        assert truth("pixel_share")(normal, offset) == pytest.approx(counted, abs=2e-3)


def test_the_grid_is_the_standard_one():
    scan = Volume(np.random.default_rng(0).random((4, 4, 4)), np.diag([50.0, 50.0, 50.0, 1.0]))
    centre = np.array([80.0, 70.0, 60.0])
    arguments = (torch.tensor(x, dtype=torch.float64) for x in (EXTENT_MM, SHAPE, centre))
    placed = place_on_grid(scan, np.eye(4), centre).volume.affine
    np.testing.assert_allclose(truth("grid_affine")(*arguments), placed)


def test_the_block_with_a_funnel_is_a_closed_surface():
    cases = EXERCISES["is_inside_out"].exercise().cases
    blocks = [Mesh(*arguments) for name, arguments in cases.items() if "block" in name]
    assert len(blocks) == 3
    for block in blocks:
        assert euler_number(block) == 2
        assert len(self_intersecting_faces(block)) == 0
        assert abs(float(signed_volume(block))) == pytest.approx(8 - 4 * 1.9 / 3)


def test_a_simple_pixel_changes_no_count():
    simple = truth("is_simple")
    for (mask,) in EXERCISES["is_simple"].exercise().cases.values():
        counts = []
        for middle in (False, True):
            padded = np.pad(mask.numpy(), 2)
            padded[3, 3] = middle
            holes = skimage.measure.euler_number(padded, connectivity=2)
            parts = skimage.measure.label(padded, connectivity=2).max()
            counts.append((holes, parts, skimage.measure.label(~padded, connectivity=1).max()))
        assert simple(mask) == (counts[0] == counts[1])


def test_a_flip_weighs_what_the_exercise_says():
    """By exact transport between varifolds of a circle, a fifth of its edges turned round."""
    contour = circle(40.0, 60)
    edges = contour.edges.clone()
    edges[:12] = edges[:12].flip(1)
    turned, straight = (varifold(c, normal_scale=3.0) for c in (Contour(contour.vertices, edges), contour))
    floor = float(wasserstein(turned, straight)) ** 0.5
    assert truth("smallest_flip")(floor, 3.0) == pytest.approx(12 / 60)


def test_the_debiased_cost_is_that_of_another_library():
    for entropic, x, y, p in list(EXERCISES["debiased"].exercise().cases.values())[:2]:
        blur = 0.5 ** (1 / p)
        divergence = sinkhorn_divergence(DiscreteMeasure(x), DiscreteMeasure(y), p, blur=blur, scaling=0.95)
        assert truth("debiased")(entropic, x, y, p) == pytest.approx(float(divergence), rel=0.01)
