"""The exercises of chapter 32: truths from the package, and a different hint for each usual mistake."""

import numpy as np
import pytest
import torch
from scipy.stats import wasserstein_distance

from meshot.model.deformation import CubeConvolution, DeformationNetwork
from meshot.volume.volume import Volume
from meshot_book.exercises import check
from meshot_book.exercises.ddot_exercises import _aligned, _counted, _regional


def by_the_network(width, hidden, n_scales, size):
    return DeformationNetwork(width, hidden, n_scales, size).n_parameters


def by_the_package(row, kernel, place):
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


def by_unit_vectors(descents, needed, masses):
    first, second = ((masses.sqrt()[:, None] * x).flatten() for x in (descents, needed))
    return torch.nn.functional.cosine_similarity(first, second, dim=0)


def by_walking(places, source_areas, target_areas):
    """The north-west corner rule."""
    p, q = (x / x.sum() for x in (source_areas.clone(), target_areas.clone()))
    found, i, j = torch.zeros_like(p), 0, 0
    left, room = p.clone(), q.clone()
    while i < len(p) and j < len(q):
        moved = torch.minimum(left[i], room[j])
        found[i] += moved * (places[j] - places[i])
        left[i], room[j] = left[i] - moved, room[j] - moved
        i, j = (i + 1, j) if left[i] <= room[j] else (i, j + 1)
    return found / p


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.count_weights, by_the_network),
        (check.feature_at, by_the_package),
        (check.alignment, by_unit_vectors),
        (check.mean_displacements, by_walking),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def test_the_displacements_are_those_of_transport():
    places = torch.tensor([0.0, 1.0, 5.0]).double()
    source, target = torch.tensor([1.0, 1.0, 2.0]).double(), torch.tensor([1.0, 2.0, 5.0]).double()
    moved = _regional(places, source, target)
    cost = float((source / source.sum() * moved).sum())  # all mass goes one way here
    assert cost == pytest.approx(wasserstein_distance(places, places, source, target))


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.count_weights, lambda w, h, s, k: _counted(w, h, s, k, biases=False), "biases are missing"),
        (check.count_weights, lambda w, h, s, k: _counted(w, h, s, k) - w * h[0], "twice the width"),
        (check.count_weights, lambda w, h, s, k: _counted(w, h, 1, k), "kernel of its own"),
        (check.count_weights, lambda w, h, s, k: _counted(w, h, s, k) + (s - 1) * w, "not for each scale"),
        (check.count_weights, lambda w, h, s, k: _counted(w, h, s, k) - s * w * k**3 + s * w * k**2, "three sides"),
        (check.count_weights, lambda w, h, s, k: _counted(w, h, s, k) - 3 * (h[-1] + 1), "last layer"),
        (check.count_weights, lambda w, h, s, k: _counted(w, h, s, k) - w * (w + 1), "behind the convolution"),
        (check.feature_at, lambda r, k, p: by_the_package(r, k.flip(0), p), "the kernel is reversed"),
        (check.feature_at, lambda r, k, p: by_the_package(r, k, int(p + 0.5)), "nearest voxel"),
        (check.feature_at, lambda r, k, p: by_the_package(r, k, int(p)), "voxel below"),
        (check.feature_at, lambda r, k, p: by_the_package(r, k, p + len(k) // 2), "kernel is centred"),
        (check.alignment, lambda p, n, m: _aligned(p, n, m * 0 + 1), "every vertex has the same weight"),
        (check.alignment, lambda p, n, m: abs(_aligned(p, n, m)), "keep the sign"),
        (check.alignment, lambda p, n, m: _aligned(p * m[:, None], n, m), "the mass enters twice"),
        (check.mean_displacements, lambda x, a, b: -by_walking(x, a, b), "sign"),
        (check.mean_displacements, lambda x, a, b: by_walking(x, a, b) * a / a.sum(), "mass times distance"),
        (check.mean_displacements, lambda x, a, b: by_walking(x, a, b) * a / a.sum() / (b / b.sum()), "target's share"),
        (check.mean_displacements, lambda x, a, b: -by_walking(x, b, a), "source and target are exchanged"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)


def clamped(row, kernel, place):
    half = len(kernel) // 2
    long = np.pad(row.numpy(), 60, mode="edge")
    return sum(
        float(kernel[o + half]) * np.interp(place + o + 60, np.arange(len(long)), long)
        for o in (-half, *range(1 - half, half + 1))
    )


def inside_only(row, kernel, place):
    features = np.correlate(row.numpy(), kernel.numpy(), "same")
    return np.interp(place, np.arange(-1, len(row) + 1), np.pad(features, 1))


@pytest.mark.parametrize(("function", "hint"), [(clamped, "copies of its end"), (inside_only, "half a kernel or more")])
def test_borders_get_their_hint(hinted, function, hint):
    hinted(check.feature_at, function, hint)


@pytest.mark.parametrize(
    ("function", "hint"),
    [
        (lambda p, n, m: (m * torch.cosine_similarity(p, n, dim=1)).sum() / m.sum(), "mean of the cosines"),
        (lambda p, n, m: (m * (p * n).sum(1)).sum() / (p.norm() * n.norm()), "the masses are in the numerator only"),
    ],
)
def test_other_cosines_get_their_hint(hinted, function, hint):
    hinted(check.alignment, function, hint)


def test_areas_that_are_not_shares_get_their_hint(hinted):
    def unnormalised(places, source, target):
        ends = [torch.cat([torch.zeros(1).double(), x.cumsum(0)]) / source.sum() for x in (source, target)]
        overlap = torch.minimum(ends[0][1:, None], ends[1][1:]) - torch.maximum(ends[0][:-1, None], ends[1][:-1])
        return (overlap.clamp(min=0) * (places - places[:, None])).sum(1) / source * source.sum()

    hinted(check.mean_displacements, unnormalised, "its own area")
