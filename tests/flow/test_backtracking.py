"""A fit that must cross its faces to get where the loss wants it, and backs off."""

import dataclasses

import pytest
import torch

from meshot.flow.crossings import crossings_along
from meshot.flow.fields import grid_around
from meshot.flow.fitting import Fit, FitSettings, FitState, Guard, backtrack, fit_flow
from meshot.mesh.connectivity import self_intersecting_faces
from meshot_book.examples.counterexample import tip_over_face

PAIR = tip_over_face(0.3)
QUICK = FitSettings(n_iterations=60, learning_rate=0.05, n_steps=2, check_every=2, save_every=3)


def through(mesh, n_directions, generator):
    """Least where the hanging tip is on the other side of the lower triangle, and all else where it was."""
    wanted = PAIR.vertices.clone()
    wanted[3, 1] = -0.3
    return (mesh.vertices - wanted).square().sum()


def field(**options):
    return grid_around(PAIR.vertices, margin=1.0, spacings=(1.0, 0.5), n_pieces=1, **options)


def test_without_a_guard_faces_cross_and_with_it_they_do_not():
    free, held = fit_flow(field(), PAIR, through, QUICK), fit_flow(field(), PAIR, through, QUICK, guard=Guard())
    assert len(self_intersecting_faces(free.mesh)) == 2
    assert len(self_intersecting_faces(held.mesh)) == 0
    assert crossings_along(held.field, PAIR, held.n_steps)[-1] == 0
    assert free.history["checked_loss"][-1] < min(held.history["checked_loss"])
    # It went as far as it could: the tip hangs just over the face, whose corners have moved a little too.
    assert 0 < float(held.mesh.vertices[3, 1] - held.mesh.vertices[:3, 1].mean()) < 0.15
    assert len(held.history["checked_crossings"]) == len(held.history["checked_loss"])
    backtracks = held.history["backtrack_iteration"]
    crossed = [i for i, n in zip(held.history["checked_iteration"], held.history["checked_crossings"]) if n]
    assert backtracks == crossed != []
    assert len(backtracks) <= 8


def test_after_a_backtrack_steps_are_smaller():
    held = fit_flow(field(), PAIR, through, QUICK, guard=Guard(slow_down=0.1))
    losses = dict(zip(held.history["iteration"], held.history["loss"]))
    first = held.history["backtrack_iteration"][0]
    fall_before = losses[first - 2] - losses[first - 1]
    # Iteration `first` starts from the best state again, and its fall is seen in the one after it.
    fall_after = losses[first] - losses[first + 1]
    assert 0 < fall_after < 0.2 * fall_before


def test_gives_up_and_keeps_the_best():
    held = fit_flow(field(), PAIR, through, QUICK, guard=Guard(max_backtracks=1))
    assert len(held.history["backtrack_iteration"]) == 1
    assert len(held.history["iteration"]) == held.history["backtrack_iteration"][0] < 60
    assert len(self_intersecting_faces(held.mesh)) == 0


def same(fit: Fit, other: Fit) -> bool:
    states = [f.field.state_dict() for f in (fit, other)]
    return (
        fit.history == other.history
        and fit.n_steps == other.n_steps
        and all(torch.equal(states[0][name], states[1][name]) for name in states[0])
    )


@pytest.mark.parametrize("stop", [5, 11])
def test_killed_and_resumed_backs_off_in_the_same_way(tmp_path, stop):
    class Killed(Exception):
        pass

    def kill(iteration, loss):
        if iteration == stop:
            raise Killed

    guard, path = Guard(max_backtracks=5), tmp_path / "fit.safetensors"
    whole = fit_flow(field(), PAIR, through, QUICK, guard=guard)
    assert same(whole, fit_flow(field(), PAIR, through, QUICK, guard=guard))
    with pytest.raises(Killed):
        fit_flow(field(), PAIR, through, QUICK, path, kill, guard)
    assert min(whole.history["backtrack_iteration"]) < 5
    assert max(whole.history["backtrack_iteration"]) > 11
    assert same(whole, fit_flow(field(), PAIR, through, QUICK, path, guard=guard))
    with pytest.raises(ValueError, match="made with another guard"):
        fit_flow(field(), PAIR, through, QUICK, path)


@pytest.mark.parametrize(("max_steps", "slope", "n_steps"), [(16, -3.0, 4), (3, -3.0, 2), (16, -0.5, 1)])
def test_more_steps_where_the_steps_are_at_fault(max_steps, slope, n_steps):
    velocity = field()
    state = FitState(velocity, 1e-3, 1)
    for level in velocity.levels:
        level.grad = torch.zeros_like(level)
    state.optimiser.step()
    assert state.optimiser.state
    nodes = torch.arange(velocity.levels[1].shape[1]).double()
    velocity.levels[1].data[..., 0] = 0.5 * slope * nodes[:, None, None]  # v = slope · x, up to a constant
    backtrack(state, PAIR, QUICK, Guard(max_steps=max_steps, slow_down=0.25))
    assert state.n_steps == n_steps
    assert state.rate_factor == 0.25
    assert not state.optimiser.state  # momentum that led to the crossing is forgotten
    assert not velocity.levels[1].any()


def test_a_mesh_that_crosses_from_the_start():
    crossed = PAIR.with_vertices(PAIR.vertices - torch.tensor([0.0, 0.6, 0.0]).double() * torch.eye(6)[3][:, None])
    with pytest.raises(ValueError, match="2 faces cross before the fit begins, 0 are allowed"):
        fit_flow(field(), crossed, through, QUICK, guard=Guard())
    assert fit_flow(field(), crossed, through, dataclasses.replace(QUICK, n_iterations=2), guard=Guard(2)).n_steps == 2


def test_early_stop():
    def flat(mesh, *_):
        return 0 * mesh.vertices.sum()

    fit = fit_flow(field(), PAIR, flat, dataclasses.replace(QUICK, patience=3))
    assert fit.history["checked_iteration"] == [2, 4, 6, 8]
    assert fit.best_iteration == 2


def test_coarse_levels_go_first():
    settings = dataclasses.replace(QUICK, n_iterations=8, coarse_share=0.5)
    assert [settings.n_stages_at(i, 2) for i in range(8)] == [1, 1, 2, 2, 2, 2, 2, 2]
    assert [settings.n_stages_at(i, 4) for i in range(5)] == [1, 2, 3, 4, 4]

    def moved_levels(n_iterations, share):
        quick = dataclasses.replace(QUICK, n_iterations=n_iterations, coarse_share=share, check_every=n_iterations)
        fit = fit_flow(field(), PAIR, through, quick)
        return [bool(level.detach().any()) for level in fit.field.levels]

    assert moved_levels(2, 1.0) == [True, True]
    assert moved_levels(1, 1.0) == [True, False]
    assert moved_levels(1, 0.0) == [True, True]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Guard(max_crossings=-1), "max_crossings is -1"),
        (lambda: Guard(slow_down=1.0), "slow_down is 1.0"),
        (lambda: Guard(max_backtracks=0), "max_backtracks is 0"),
        (lambda: FitSettings(patience=0), "patience is 0"),
        (lambda: FitSettings(method="heun"), "method is 'heun'"),
        (lambda: FitSettings(gradient="none"), "gradient is 'none'"),
        (lambda: FitSettings(coarse_share=1.5), "coarse_share is 1.5"),
    ],
)
def test_doors(make, words):
    with pytest.raises(ValueError, match=words):
        make()
