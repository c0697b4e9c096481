import dataclasses
import functools
import math

import pytest
import torch

from meshot.flow.fields import grid_around
from meshot.flow.fitting import FitSettings, fit_flow, sliced_loss
from meshot.loss.transport import chamfer
from meshot.measure.discrete import DiscreteMeasure, empirical, varifold
from meshot.mesh.shapes import ellipsoid, icosphere

SOURCE, TARGET = icosphere(2, 10.0), ellipsoid(2, (11.0, 9.0, 10.0))
QUICK = FitSettings(n_iterations=12, n_steps=4, n_directions=(4, 8), check_every=5, save_every=4)


def quick_field():
    return grid_around(SOURCE.vertices, TARGET.vertices, margin=4.0, spacings=(12.0, 6.0), n_pieces=2)


def quick_loss():
    return sliced_loss(TARGET, functools.partial(varifold, normal_scale=2.0))


def weights(fit):
    return torch.cat([value.flatten() for value in fit.field.state_dict().values()])


class Killed(Exception):
    pass


def test_reaches_the_target():
    settings = dataclasses.replace(QUICK, n_iterations=120, n_directions=(16, 32))
    field = quick_field()
    fit = fit_flow(field, SOURCE, quick_loss(), settings)
    before, after = fit.history["checked_loss"][0], fit.history["checked_loss"][-1]
    assert after < before / 50
    # The unit sphere's image is the ellipsoid up to sliding along it; its extent is known.
    extent = fit.mesh.vertices.amax(dim=0) - fit.mesh.vertices.amin(dim=0)
    torch.testing.assert_close(extent, torch.tensor([22.0, 18.0, 20.0]).double(), atol=0.4, rtol=0)
    assert fit.best_iteration == 120
    assert all(not level.any() for level in field.levels)
    assert fit.history["n_directions"][0] == 16
    assert fit.history["n_directions"][-1] == 32


def test_same_seed_same_field_other_seed_another():
    fits = [fit_flow(quick_field(), SOURCE, quick_loss(), dataclasses.replace(QUICK, seed=s)) for s in (3, 3, 4)]
    assert torch.equal(weights(fits[0]), weights(fits[1]))
    assert fits[0].history == fits[1].history
    assert not torch.equal(weights(fits[0]), weights(fits[2]))


def test_every_iteration_draws_anew_and_every_check_the_same():
    draws = {True: [], False: []}

    def loss(mesh, n_directions, generator):
        draws[torch.is_grad_enabled()].append(int(generator.integers(2**60)))
        return mesh.vertices.square().mean()

    fit_flow(quick_field(), SOURCE, loss, QUICK)
    assert len(set(draws[True])) == 12
    assert len(draws[False]) == 3
    assert len(set(draws[False])) == 1
    assert not set(draws[False]) & set(draws[True])


@pytest.mark.parametrize("stop", [3, 4, 7, 11])
def test_killed_and_resumed_ends_in_the_same_field(tmp_path, stop):
    def kill(iteration, loss):
        if iteration == stop:
            raise Killed

    whole = fit_flow(quick_field(), SOURCE, quick_loss(), QUICK)
    path = tmp_path / "fit.safetensors"
    with pytest.raises(Killed):
        fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, checkpoint=path, progress=kill)
    seen = []
    resumed = fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path, progress=lambda i, loss: seen.append(i))
    assert seen[0] == stop // 4 * 4 + 1
    assert torch.equal(weights(whole), weights(resumed))
    assert torch.equal(whole.mesh.vertices, resumed.mesh.vertices)
    assert whole.history == resumed.history
    assert torch.equal(weights(fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path)), weights(whole))


def test_what_is_watched_is_kept_through_a_kill(tmp_path):
    def watch(mesh):
        return {"width": float(mesh.vertices[:, 0].amax() - mesh.vertices[:, 0].amin())}

    def kill(iteration, loss):
        if iteration == 9:  # the checkpoint at 8 holds the check at 5
            raise Killed

    whole = fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, watch=watch)
    assert whole.history["checked_iteration"] == [5, 10, 12]
    assert len(whole.history["width"]) == 3
    assert whole.history["width"][-1] == watch(whole.mesh)["width"] > 20.1
    assert torch.equal(weights(whole), weights(fit_flow(quick_field(), SOURCE, quick_loss(), QUICK)))
    path = tmp_path / "fit.safetensors"
    with pytest.raises(Killed):
        fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, checkpoint=path, progress=kill, watch=watch)
    assert fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, checkpoint=path, watch=watch).history == whole.history


def test_what_is_watched_must_not_hide_the_history():
    with pytest.raises(ValueError, match="'loss', which the history holds"):
        fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, watch=lambda mesh: {"loss": 1.0})


def test_best_state_is_kept():
    def worsening(mesh, n_directions, generator):
        count.append(1)
        return (1 + len(count)) * mesh.vertices.square().mean()

    count = []
    fit = fit_flow(quick_field(), SOURCE, worsening, dataclasses.replace(QUICK, check_every=1, learning_rate=1e-6))
    assert fit.best_iteration == 1
    # One step of Adam moves every coefficient by the learning rate at most; the last of twelve would be farther.
    assert 0 < max(float(level.detach().abs().max()) for level in fit.field.levels) < 1.01e-6


@pytest.mark.parametrize(
    "encode", [lambda mesh: DiscreteMeasure(mesh.vertices), lambda mesh: empirical(mesh, 300, 7, detach_weights=True)]
)
def test_any_loss_on_any_encoding(encode):
    target = encode(TARGET)
    fit = fit_flow(
        quick_field(),
        SOURCE,
        lambda mesh, *_: chamfer(encode(mesh), target),
        dataclasses.replace(QUICK, n_iterations=60),
    )
    assert fit.history["checked_loss"][-1] < 0.6 * fit.history["checked_loss"][0]


def test_nan_is_named_and_the_checkpoint_is_good(tmp_path):
    def turns_bad(mesh, n_directions, generator):
        calls.append(1)
        return mesh.vertices.square().mean() * (math.nan if len(calls) == 8 else 1)

    calls, path = [], tmp_path / "fit.safetensors"
    with pytest.raises(FloatingPointError, match="the loss of step 6 \\(of the fit\\) is not finite"):
        fit_flow(quick_field(), SOURCE, turns_bad, QUICK, path)
    resumed = fit_flow(quick_field(), SOURCE, lambda mesh, *_: mesh.vertices.square().mean(), QUICK, path)
    assert bool(torch.isfinite(weights(resumed)).all())


def test_infinite_gradient_is_named():
    def steep(mesh, n_directions, generator):
        return (mesh.vertices[:, 0] - mesh.vertices[:, 0].detach()).abs().sqrt().sum()

    with pytest.raises(FloatingPointError, match=r"the gradient in levels.0 of step 0 \(of the fit\) is not finite"):
        fit_flow(quick_field(), SOURCE, steep, QUICK)


def test_schedules():
    settings = FitSettings(n_iterations=90, n_directions=(16, 64), learning_rate=0.4)
    assert [settings.n_directions_at(i) for i in (0, 29, 30, 59, 60, 89)] == [16, 16, 32, 32, 64, 64]
    assert [settings.plan().learning_rate_at(i) for i in (0, 45, 90)] == pytest.approx([0.4, 0.2, 0], abs=1e-15)
    odd = FitSettings(n_iterations=10, n_directions=(10, 25))
    assert {odd.n_directions_at(i) for i in range(10)} == {10, 20, 25}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"n_iterations": 0}, "n_iterations is 0"),
        ({"learning_rate": math.nan}, "learning_rate is nan"),
        ({"n_directions": (8, 4)}, "do not decrease"),
        ({"n_directions": (0, 4)}, "n_directions is 0"),
    ],
)
def test_doors_of_the_settings(arguments, words):
    with pytest.raises(ValueError, match=words):
        FitSettings(**arguments)


def test_doors_of_the_checkpoint(tmp_path):
    path = tmp_path / "fit.safetensors"
    fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path)
    with pytest.raises(ValueError, match="made with another seed"):
        fit_flow(quick_field(), SOURCE, quick_loss(), dataclasses.replace(QUICK, seed=1), path)
    with pytest.raises(ValueError, match="is the state of another training"):
        fit_flow(grid_around(SOURCE.vertices, spacings=(12.0,)), SOURCE, quick_loss(), QUICK, path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match="not a whole state of a training"):
        fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path)
