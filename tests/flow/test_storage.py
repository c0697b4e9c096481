"""A velocity through a file: the same flow, in few bytes, or a clear refusal."""

import numpy as np
import pytest
import torch

from meshot.flow.fields import GridVelocity, quantised_velocity, read_velocity, write_velocity
from meshot.flow.integration import integrate


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
    with pytest.raises(ValueError, match="larger step"):
        quantised_velocity(field, 1e-6)
    with pytest.raises(ValueError, match="positive"):
        quantised_velocity(field, 0.0)
    with pytest.raises(ValueError, match=r"safetensors\.gz"):
        write_velocity(tmp_path / "v.npz", field)


def test_broken_files_are_refused(tmp_path, field):
    path = tmp_path / "v.safetensors.gz"
    write_velocity(path, field)
    whole = path.read_bytes()
    for content in (b"", b"garbage", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="not a complete velocity file"):
            read_velocity(path)
    with pytest.raises(ValueError, match="not a complete velocity file"):
        read_velocity(tmp_path / "missing.safetensors.gz")
