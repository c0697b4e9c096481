import numpy as np
import pytest
import torch
from scipy.interpolate import BSpline, RegularGridInterpolator

from meshot.flow.fields import plain_spline_values, refined, spline_values


def lattice(*shape, seed=0, dtype=torch.float64):
    return torch.from_numpy(np.random.default_rng(seed).standard_normal((*shape, 3))).to(dtype)


def places(n, low, high, seed=1, dtype=torch.float64):
    return torch.from_numpy(np.random.default_rng(seed).uniform(low, high, (n, 3))).to(dtype)


def test_against_scipy():
    coefficients, where = lattice(6, 7, 5), places(40, 1, 3)
    basis = [BSpline.basis_element(np.arange(-2, 3) + j, extrapolate=False) for j in range(7)]
    value = [[np.nan_to_num(basis[j](where[:, axis].numpy())) for j in range(7)] for axis in range(3)]
    x, y, z = (np.array(v)[:n] for v, n in zip(value, (6, 7, 5), strict=True))
    expected = np.einsum("an,bn,cn,abck->nk", x, y, z, coefficients.numpy())
    np.testing.assert_allclose(spline_values(coefficients, where), expected, atol=1e-13)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_kernel_agrees_with_its_plain_twin(dtype):
    coefficients = lattice(6, 5, 7, dtype=dtype).requires_grad_()
    where = torch.cat([places(5000, -3, 9, dtype=dtype), torch.tensor([[1, 3, 5], [4, 3, 5], [1, 1, 1]], dtype=dtype)])
    where.requires_grad_()
    upstream = places(len(where), -1, 1, seed=2, dtype=dtype)
    found, expected = spline_values(coefficients, where), plain_spline_values(coefficients, where)
    torch.testing.assert_close(found, expected)
    for gradient, other in zip(
        torch.autograd.grad(found, (coefficients, where), upstream),
        torch.autograd.grad(expected, (coefficients, where), upstream),
        strict=True,
    ):
        torch.testing.assert_close(gradient, other, rtol=1e-5 if dtype == torch.float32 else 1e-9, atol=2e-5)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_gradcheck(interpolation):
    coefficients, where = lattice(4, 5, 4).requires_grad_(), places(9, -0.5, 4.5).requires_grad_()
    assert torch.autograd.gradcheck(lambda c, w: spline_values(c, w, interpolation), (coefficients, where))


def test_same_for_any_number_of_threads_up_to_rounding():
    coefficients, where = lattice(8, 8, 8).requires_grad_(), places(9000, 0, 8)
    threads, gradients = torch.get_num_threads(), []
    try:
        for n in (1, 2, 3):
            torch.set_num_threads(n)
            once, again = (torch.autograd.grad(spline_values(coefficients, where).sum(), coefficients)[0] for _ in "ab")
            assert torch.equal(once, again)
            gradients.append(once)
    finally:
        torch.set_num_threads(threads)
    torch.testing.assert_close(gradients[1], gradients[0])
    torch.testing.assert_close(gradients[2], gradients[0])


def test_nan_stays_nan_and_reads_nothing_outside():
    where = torch.tensor([[float("nan"), 2, 2], [2, float("inf"), -float("inf")]], dtype=torch.float64)
    values = spline_values(lattice(4, 4, 4), where)
    assert bool(torch.isfinite(values[1]).all())


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_refining_changes_nothing(interpolation):
    coarse, where = lattice(5, 4, 6), places(200, -1, 6)
    fine = refined(coarse, interpolation)
    assert fine.shape == (7, 5, 9, 3)
    inside = where.clamp(min=1).minimum(torch.tensor([3.0, 2.0, 4.0]))
    torch.testing.assert_close(
        spline_values(fine, 2 * inside - 1, interpolation), spline_values(coarse, where, interpolation)
    )


def test_linear_against_scipy():
    coefficients, where = lattice(6, 7, 5), places(40, -1, 7)
    scipy = RegularGridInterpolator([np.arange(n) for n in (6, 7, 5)], coefficients.numpy())
    inside = where.clamp(min=1).minimum(torch.tensor([4.0, 5.0, 3.0]))
    np.testing.assert_allclose(spline_values(coefficients, where, "linear"), scipy(inside.numpy()), atol=1e-13)


def test_too_small_a_lattice():
    with pytest.raises(ValueError, match="four nodes along every axis"):
        spline_values(lattice(4, 3, 4), places(2, 0, 1))
