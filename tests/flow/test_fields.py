"""Splines against SciPy, and a velocity through a file."""

import numpy as np
import pytest
import torch
from scipy.interpolate import BSpline, RegularGridInterpolator

from meshot.flow.fields import (
    GridVelocity,
    plain_spline_values,
    quantised_velocity,
    read_velocity,
    refined,
    spline_values,
    write_velocity,
)
from meshot.flow.integration import integrate
from refusals import refuses


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


@pytest.fixture
def field() -> GridVelocity:
    made = GridVelocity(
        torch.tensor([-13.0, 2, 5]).double(), torch.tensor([11.0, 40, 29]).double(), (12.0, 6.0, 3.0), 2
    )
    generator = np.random.default_rng(0)
    with torch.no_grad():
        for level in made.levels:
            level.copy_(torch.from_numpy(generator.normal(size=level.shape)))
    return made


@pytest.fixture
def points() -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(1).uniform(-10, 40, size=(200, 3)))


def test_one_level_is_the_same_field_to_half_a_step(field, points):
    single = quantised_velocity(field, 0.01)
    assert single.spacings == (3.0,)
    for time in (0.1, 0.7):
        moment = torch.tensor(time).double()
        gap = (single(moment, points) - field(moment, points)).detach().abs().max()
        assert 0 < float(gap) <= 0.005


def test_there_and_back(tmp_path, field, points):
    write_velocity(tmp_path / "v.safetensors.gz", field)
    again = read_velocity(tmp_path / "v.safetensors.gz")
    expected = quantised_velocity(field)
    assert torch.equal(again.coefficients(), expected.coefficients())
    assert torch.equal(integrate(again, points, 4), integrate(expected, points, 4))
    assert float((integrate(again, points, 4) - integrate(field, points, 4)).detach().abs().max()) < 0.1


def test_linear_stays_linear(tmp_path, points):
    field = GridVelocity(torch.zeros(3).double(), torch.full((3,), 20.0).double(), (4.0,), 1, "linear")
    field.levels[0].data = torch.from_numpy(np.random.default_rng(3).integers(-9, 9, field.levels[0].shape)).double()
    write_velocity(tmp_path / "v.safetensors.gz", field)
    again, moment = read_velocity(tmp_path / "v.safetensors.gz"), torch.tensor(0.5).double()
    assert torch.equal(again(moment, points), field(moment, points))


def test_the_same_field_gives_the_same_bytes(tmp_path, field):
    for name in ("a", "b"):
        write_velocity(tmp_path / f"{name}.safetensors.gz", field)
    assert (tmp_path / "a.safetensors.gz").read_bytes() == (tmp_path / "b.safetensors.gz").read_bytes()


def test_single_precision_stays_single(tmp_path, field):
    write_velocity(tmp_path / "v.safetensors.gz", field.float())
    assert read_velocity(tmp_path / "v.safetensors.gz").coefficients().dtype == torch.float32


def test_what_does_not_fit_is_said(tmp_path, field):
    refuses("larger step", quantised_velocity, field, 1e-6)
    refuses("positive", quantised_velocity, field, 0.0)
    refuses(r"safetensors\.gz", write_velocity, tmp_path / "v.npz", field)


def test_broken_files_are_refused(tmp_path, field):
    path = tmp_path / "v.safetensors.gz"
    write_velocity(path, field)
    whole = path.read_bytes()
    for content in (b"", b"garbage", whole[: len(whole) // 2]):
        path.write_bytes(content)
        refuses("not a complete velocity file", read_velocity, path)
    refuses("not a complete velocity file", read_velocity, tmp_path / "missing.safetensors.gz")
