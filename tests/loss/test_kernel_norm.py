"""The kernel norm of varifolds: closed forms, GeomLoss, a slow twin, gradients, invariance, refused input."""

import functools

import geomloss
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from meshot import DiscreteMeasure, varifold
from meshot.loss import varifold_kernel
from meshot.loss.kernel_norm import ANGULAR
from meshot.mesh import icosphere
from refusals import refuses


def oriented(seed, n, scale=1.0, dtype=torch.float64):
    """Points with normals of a length, and unequal masses."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(n, 3))
    normals *= scale / np.linalg.norm(normals, axis=1, keepdims=True)
    points = torch.from_numpy(np.hstack([random.normal(size=(n, 3)), normals])).to(dtype)
    masses = torch.from_numpy(random.dirichlet(np.ones(n))).to(dtype)
    return DiscreteMeasure(points, masses)


def slow(source, target, width, angular):
    """The definition, pair by pair."""
    gamma = {"currents": lambda u: u, "varifold": lambda u: u**2, "oriented": lambda u: np.exp(8 * (u - 1))}[angular]

    def inner(p, q):
        total = 0.0
        for x, a in zip(p.points.numpy(), p.weights.numpy()):
            for y, b in zip(q.points.numpy(), q.weights.numpy()):
                u = x[3:] @ y[3:] / np.linalg.norm(x[3:]) / np.linalg.norm(y[3:])
                total += a * b * np.exp(-((x[:3] - y[:3]) ** 2).sum() / width**2) * gamma(u)
        return total

    return inner(source, source) - 2 * inner(source, target) + inner(target, target)


@pytest.fixture(params=["compiled", "one block of pairs", "blocks of pairs"])
def path(request, monkeypatch):
    """All ways of computing it: the kernels, and PyTorch with large and with small blocks."""
    if request.param != "compiled":
        monkeypatch.setattr("meshot.loss.kernel_norm.takes_kernel", lambda points: False)
    if request.param == "blocks of pairs":
        monkeypatch.setattr("meshot.loss.kernel_norm._BLOCK", 20)
    return request.param


@pytest.mark.parametrize("angular", ANGULAR)
def test_the_definition(angular, path):
    source, target = oriented(0, 17), oriented(1, 13, scale=4.0)
    found = float(varifold_kernel(source, target, 0.8, angular))
    assert found == pytest.approx(slow(source, target, 0.8, angular), rel=1e-12)


def test_equal_normals_leave_the_gaussian_norm_of_another_library():
    """GeomLoss's kernel is exp(−d²/(2 blur²)), and its value half the squared norm."""
    source, target = oriented(2, 30), oriented(3, 20)
    for measure in (source, target):
        measure.points[:, 3:] = torch.tensor([0.0, 0.0, 1.0])
    other = geomloss.SamplesLoss("gaussian", blur=0.9 / 2**0.5, backend="tensorized")
    expected = 2 * other(*(t.contiguous() for m in (source, target) for t in (m.weights, m.points[:, :3])))
    for angular in ANGULAR:
        assert float(varifold_kernel(source, target, 0.9, angular)) == pytest.approx(float(expected), rel=1e-10)


@pytest.mark.parametrize(
    ("angular", "value"), [("currents", 4.0), ("varifold", 0.0), ("oriented", 2 - 2 * np.exp(-16))]
)
def test_opposite_normals_in_one_place(angular, value):
    one = oriented(4, 1)
    turned = DiscreteMeasure(one.points * torch.tensor([1.0, 1, 1, -1, -1, -1]))
    assert float(varifold_kernel(one, turned, 1.0, angular)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("angular", ANGULAR)
def test_zero_between_equal_varifolds_symmetric_and_invariant(angular):
    source, target = oriented(5, 20), oriented(6, 25)
    loss = functools.partial(varifold_kernel, width=1.3, angular=angular)
    assert abs(float(loss(source, source))) < 1e-15
    value = float(loss(source, target))
    assert float(loss(target, source)) == pytest.approx(value, rel=1e-12)
    turn = torch.from_numpy(Rotation.from_euler("xyz", [0.3, -1, 2]).as_matrix())

    def moved(m):
        return DiscreteMeasure(torch.cat([m.points[:, :3] @ turn.T + 7, m.points[:, 3:] @ turn.T], dim=1), m.weights)

    assert float(loss(moved(source), moved(target))) == pytest.approx(value, rel=1e-10)


@pytest.mark.parametrize("angular", ANGULAR)
def test_gradients(angular, path):
    """In points and masses of the source, of the target, and of both."""
    source, target = oriented(7, 6), oriented(8, 5)
    tensors = [t.clone().requires_grad_() for m in (source, target) for t in (m.points, m.weights.log())]

    def value(points, logits, other_points, other_logits):
        first = DiscreteMeasure(points, logits.softmax(0))
        return varifold_kernel(first, DiscreteMeasure(other_points, other_logits.softmax(0)), 0.9, angular)

    fixed = [t.detach() for t in tensors]
    some = [*tensors[:2], *fixed[2:]], [*fixed[:2], *tensors[2:]], [*fixed[:1], *tensors[1:]]
    for given in (tensors, *(some if path == "compiled" else ())):  # PyTorch itself leaves out what is not wanted
        assert torch.autograd.gradcheck(value, given)


def several_clusters(seed, n, dtype):
    """Many blocks of points, in clusters of which some lie beyond the reach of the kernel of others."""
    near = oriented(seed, n, dtype=dtype)
    places = torch.tensor([[0.0, 0, 0], [4, 0, 0], [0, 30, 0]], dtype=dtype).repeat_interleave(-(-n // 3), dim=0)[:n]
    return DiscreteMeasure(near.points + torch.nn.functional.pad(places, (0, 3)), near.weights)


@pytest.mark.parametrize("angular", ANGULAR)
@pytest.mark.parametrize(("dtype", "digits"), [(torch.float64, 1e-13), (torch.float32, 1e-4)])
def test_both_computations_agree_on_many_points(angular, dtype, digits, monkeypatch):
    """Also where the kernels leave out pairs of distant blocks. In float32, the other computation loses digits."""
    source, target = several_clusters(9, 700, dtype), several_clusters(10, 500, dtype)
    found = {}
    for path in ("compiled", "pairs"):
        monkeypatch.setattr("meshot.loss.kernel_norm.takes_kernel", lambda points, path=path: path == "compiled")
        tensors = [t.clone().requires_grad_() for m in (source, target) for t in (m.points, m.weights)]
        value = varifold_kernel(DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:]), 1.5, angular)
        without = varifold_kernel(source, target, 1.5, angular)
        assert float(without) == pytest.approx(float(value.detach()), rel=100 * digits)
        value.backward()
        found[path] = [value.detach(), *(t.grad for t in tensors)]
    for compiled, plain in zip(*found.values()):
        assert compiled.dtype == plain.dtype == dtype
        assert float((compiled - plain).abs().max() / plain.abs().max()) < digits


def test_single_precision_far_from_the_origin():
    """Squared distances are taken around the middle of the target, so that a shift of 100 widths costs no digits."""
    near = [varifold(icosphere(2, radius), normal_scale=1.0) for radius in (10.0, 11.0)]
    expected = float(varifold_kernel(*near, 4.0))
    shift = torch.tensor([400.0, -300, 200, 0, 0, 0])
    far = [DiscreteMeasure((m.points + shift).float(), m.weights.float()) for m in near]
    # The points themselves are rounded at 400: 3e-5 of a unit, of a width of 4.
    assert float(varifold_kernel(*far, 4.0)) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("points", "words", "said"),
    [
        (torch.zeros(4, 3), {}, r"lie in R\^3; R\^6 is needed"),
        (torch.zeros(4, 6), {}, "4 normals have length zero"),
        (torch.ones(4, 6), {"width": 0.0}, "width is 0.0"),
        (torch.ones(4, 6), {"width": float("nan")}, "width is nan"),
        (torch.ones(4, 6), {"angular": "normal"}, "angular is 'normal'; one of currents, varifold, oriented"),
    ],
)
def test_refused(points, words, said):
    measure = DiscreteMeasure(points.double())
    refuses(said, varifold_kernel, measure, measure, **words)
