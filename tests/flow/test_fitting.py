"""Fits: they reach the target, go on after a kill, back off from crossings, and refuse what they cannot do."""

import dataclasses
import functools
import math
import re
import warnings

import numpy as np
import pytest
import torch
import trimesh

import meshot
from meshot import Mesh, deform, integrate
from meshot.flow.crossings import crossings_along
from meshot.flow.fields import grid_around
from meshot.flow.fitting import Fit, FitSettings, FitState, Guard, backtrack, fit_flow, sliced_loss
from meshot.loss.transport import chamfer
from meshot.measure.discrete import DiscreteMeasure, empirical, varifold
from meshot.mesh import united
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.editing import edge_splits, with_edges_split
from meshot.mesh.geometry import edge_lengths, face_areas, signed_volume
from meshot.mesh.shapes import cube, ellipsoid, folded_sphere, icosphere, split_in_four
from meshot.metrics.distances import Surface, average_surface_distance, offsets_between
from meshot_book.examples.counterexample import tip_over_face
from refusals import refuses

SOURCE, TARGET = icosphere(2, 10.0), ellipsoid(2, (11.0, 9.0, 10.0))
QUICK = FitSettings(n_iterations=12, n_steps=4, n_directions=(4, 8), check_every=5, save_every=4)


def quick_field():
    return grid_around(SOURCE.vertices, TARGET.vertices, margin=4.0, spacings=(12.0, 6.0), n_pieces=2)


def quick_loss():
    return sliced_loss(TARGET, functools.partial(varifold, normal_scale=2.0))


def weights(fit):
    return torch.cat([value.flatten() for value in fit.field.state_dict().values()])


def same(fit: Fit, other: Fit) -> bool:
    """Whether two fits made the same field, by the same steps."""
    return torch.equal(weights(fit), weights(other)) and (fit.history, fit.n_steps) == (other.history, other.n_steps)


class Killed(Exception):
    pass


def kill_at(stop):
    def kill(iteration, loss):
        if iteration == stop:
            raise Killed

    return kill


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
    assert same(fits[0], fits[1])
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


@pytest.mark.parametrize("stop", [3, 4, 11])
def test_killed_and_resumed_ends_in_the_same_field(tmp_path, stop):
    whole = fit_flow(quick_field(), SOURCE, quick_loss(), QUICK)
    path = tmp_path / "fit.safetensors"
    with pytest.raises(Killed):
        fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, checkpoint=path, progress=kill_at(stop))
    seen = []
    resumed = fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path, progress=lambda i, loss: seen.append(i))
    assert seen[0] == stop // 4 * 4 + 1
    assert same(whole, resumed)
    assert torch.equal(whole.mesh.vertices, resumed.mesh.vertices)
    assert torch.equal(weights(fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path)), weights(whole))


def test_what_is_watched_is_kept_through_a_kill(tmp_path):
    def watch(mesh):
        return {"width": float(mesh.vertices[:, 0].amax() - mesh.vertices[:, 0].amin())}

    whole = fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, watch=watch)
    assert whole.history["checked_iteration"] == [5, 10, 12]
    assert len(whole.history["width"]) == 3
    assert whole.history["width"][-1] == watch(whole.mesh)["width"] > 20.1
    assert torch.equal(weights(whole), weights(fit_flow(quick_field(), SOURCE, quick_loss(), QUICK)))
    path = tmp_path / "fit.safetensors"
    with pytest.raises(Killed):
        # The checkpoint at 8 holds the check at 5.
        fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, checkpoint=path, progress=kill_at(9), watch=watch)
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
    settings = dataclasses.replace(QUICK, n_iterations=60)
    fit = fit_flow(quick_field(), SOURCE, lambda mesh, *_: chamfer(encode(mesh), target), settings)
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


def test_doors_of_the_checkpoint(tmp_path):
    path = tmp_path / "fit.safetensors"
    fit_flow(quick_field(), SOURCE, quick_loss(), QUICK, path)
    other, coarse = dataclasses.replace(QUICK, seed=1), grid_around(SOURCE.vertices, spacings=(12.0,))
    refuses("made with another seed", fit_flow, quick_field(), SOURCE, quick_loss(), other, path)
    refuses("is the state of another training", fit_flow, coarse, SOURCE, quick_loss(), QUICK, path)
    path.write_bytes(path.read_bytes()[:-100])
    refuses("not a whole state of a training", fit_flow, quick_field(), SOURCE, quick_loss(), QUICK, path)


PAIR = tip_over_face(0.3)
BACKTRACKING_QUICK = FitSettings(n_iterations=60, learning_rate=0.05, n_steps=2, check_every=2, save_every=3)


def through(mesh, n_directions, generator):
    """Least where the hanging tip is on the other side of the lower triangle, and all else where it was."""
    wanted = PAIR.vertices.clone()
    wanted[3, 1] = -0.3
    return (mesh.vertices - wanted).square().sum()


def field(**options):
    return grid_around(PAIR.vertices, margin=1.0, spacings=(1.0, 0.5), n_pieces=1, **options)


def test_without_a_guard_faces_cross_and_with_it_they_do_not():
    free, held = (fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, guard=guard) for guard in (None, Guard()))
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
    held = fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, guard=Guard(slow_down=0.1))
    losses = dict(zip(held.history["iteration"], held.history["loss"]))
    first = held.history["backtrack_iteration"][0]
    fall_before = losses[first - 2] - losses[first - 1]
    # Iteration `first` starts from the best state again, and its fall is seen in the one after it.
    fall_after = losses[first] - losses[first + 1]
    assert 0 < fall_after < 0.2 * fall_before


def test_gives_up_and_keeps_the_best():
    held = fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, guard=Guard(max_backtracks=1))
    assert len(held.history["backtrack_iteration"]) == 1
    assert len(held.history["iteration"]) == held.history["backtrack_iteration"][0] < 60
    assert len(self_intersecting_faces(held.mesh)) == 0


@pytest.mark.parametrize("stop", [5, 11])
def test_killed_and_resumed_backs_off_in_the_same_way(tmp_path, stop):
    guard, path = Guard(max_backtracks=5), tmp_path / "fit.safetensors"
    whole = fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, guard=guard)
    assert same(whole, fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, guard=guard))
    with pytest.raises(Killed):
        fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, path, kill_at(stop), guard)
    assert min(whole.history["backtrack_iteration"]) < 5
    assert max(whole.history["backtrack_iteration"]) > 11
    assert same(whole, fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, path, guard=guard))
    with pytest.raises(ValueError, match="made with another guard"):
        fit_flow(field(), PAIR, through, BACKTRACKING_QUICK, path)


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
    backtrack(state, PAIR, BACKTRACKING_QUICK, Guard(max_steps=max_steps, slow_down=0.25))
    assert state.n_steps == n_steps
    assert state.rate_factor == 0.25
    assert not state.optimiser.state  # momentum that led to the crossing is forgotten
    assert not velocity.levels[1].any()


def test_a_mesh_that_crosses_from_the_start():
    crossed = PAIR.with_vertices(PAIR.vertices - torch.tensor([0.0, 0.6, 0.0]).double() * torch.eye(6)[3][:, None])
    with pytest.raises(ValueError, match="2 faces cross before the fit begins, 0 are allowed"):
        fit_flow(field(), crossed, through, BACKTRACKING_QUICK, guard=Guard())
    short = dataclasses.replace(BACKTRACKING_QUICK, n_iterations=2)
    assert fit_flow(field(), crossed, through, short, guard=Guard(2)).n_steps == 2


def test_early_stop():
    def flat(mesh, *_):
        return 0 * mesh.vertices.sum()

    fit = fit_flow(field(), PAIR, flat, dataclasses.replace(BACKTRACKING_QUICK, patience=3))
    assert fit.history["checked_iteration"] == [2, 4, 6, 8]
    assert fit.best_iteration == 2


def test_coarse_levels_go_first():
    settings = dataclasses.replace(BACKTRACKING_QUICK, n_iterations=8, coarse_share=0.5)
    assert [settings.n_stages_at(i, 2) for i in range(8)] == [1, 1, 2, 2, 2, 2, 2, 2]
    assert [settings.n_stages_at(i, 4) for i in range(5)] == [1, 2, 3, 4, 4]

    def moved_levels(n_iterations, share):
        own = {"n_iterations": n_iterations, "coarse_share": share, "check_every": n_iterations}
        fit = fit_flow(field(), PAIR, through, dataclasses.replace(BACKTRACKING_QUICK, **own))
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
        (lambda: FitSettings(n_iterations=0), "n_iterations is 0"),
        (lambda: FitSettings(learning_rate=math.nan), "learning_rate is nan"),
        (lambda: FitSettings(n_directions=(8, 4)), "do not decrease"),
        (lambda: FitSettings(n_directions=(0, 4)), "n_directions is 0"),
        (lambda: FitSettings(patience=0), "patience is 0"),
        (lambda: FitSettings(method="heun"), "method is 'heun'"),
        (lambda: FitSettings(gradient="none"), "gradient is 'none'"),
        (lambda: FitSettings(coarse_share=1.5), "coarse_share is 1.5"),
    ],
)
def test_doors(make, words):
    refuses(words, make)


#: Few iterations end far from the target, and say so.
pytestmark = pytest.mark.filterwarnings("ignore:the deformation is doubtful")
DEFORMING_QUICK = {"n_iterations": 60, "detail": 0.15, "progress": False}


def pair(scale: float, dtype: torch.dtype = torch.float64) -> tuple[Mesh, Mesh]:
    source, target = icosphere(2, 1.0), folded_sphere(2, 1.0, 0.25, 4)
    return tuple(mesh.with_vertices(scale * mesh.vertices).to(dtype) for mesh in (source, target))


def distance(one: Mesh, other: Mesh) -> float:
    return average_surface_distance(*offsets_between(Surface(one), Surface(other), 5000))


@pytest.fixture(scope="module")
def at_one():
    return deform(*pair(1.0), **DEFORMING_QUICK)


def test_the_flow_carries_the_sphere_to_the_folds(at_one):
    source, target = pair(1.0)
    assert distance(at_one.mesh, target) < 0.35 * distance(source, target)
    assert at_one.losses[-1] < 0.1
    assert torch.equal(at_one.mesh.faces, source.faces)
    assert len(self_intersecting_faces(at_one.mesh)) == 0


def test_the_detail_is_a_share_of_half_the_longest_side(at_one):
    everything = torch.cat([mesh.vertices for mesh in pair(1.0)])
    longest = float((everything.amax(dim=0) - everything.amin(dim=0)).max())
    assert at_one.flow.spacings[-1] == pytest.approx(DEFORMING_QUICK["detail"] * longest / 2, rel=1e-12)


def test_the_flow_that_is_returned_makes_the_mesh(at_one):
    source, _ = pair(1.0)
    made = integrate(at_one.flow, source.vertices, at_one.n_steps)
    torch.testing.assert_close(made.detach(), at_one.mesh.vertices, rtol=0, atol=1e-12)
    there = at_one.carry(source.vertices)
    assert torch.equal(there, made)
    # Euler's inverse errs by the order of a step: far less than what was moved.
    back = at_one.carry(there, inverse=True)
    missed, moved = ((points - source.vertices).detach().norm(dim=1).mean() for points in (back, there))
    assert float(missed) < 0.2 * float(moved)


@pytest.mark.parametrize("scale", [pytest.param(100.0, marks=pytest.mark.thorough), 1e-3])
def test_the_same_settings_do_at_every_size(at_one, scale):
    """Vertices are rounded differently at every size, and sixty steps of Adam enlarge that: the first steps agree."""
    few = DEFORMING_QUICK | {"n_iterations": 5}
    one, found = deform(*pair(1.0), **few), deform(*pair(scale), **few)
    torch.testing.assert_close(found.mesh.vertices / scale, one.mesh.vertices, rtol=0, atol=1e-6)
    whole = deform(*pair(scale), **DEFORMING_QUICK)
    assert whole.losses[-1] == pytest.approx(at_one.losses[-1], rel=0.1)
    assert whole.n_steps == at_one.n_steps


def test_a_place_far_from_the_origin_is_as_good(at_one):
    shift = torch.tensor([50.0, -20.0, 8.0], dtype=torch.float64)
    found = deform(*(mesh.with_vertices(mesh.vertices + shift) for mesh in pair(1.0)), **DEFORMING_QUICK)
    # Coordinates near 50 are rounded 50 times more coarsely, and Adam's path is chaotic: where it ends is alike.
    goal = pair(1.0)[1]
    near = [distance(mesh, goal) for mesh in (at_one.mesh, found.mesh.with_vertices(found.mesh.vertices - shift))]
    assert near[1] == pytest.approx(near[0], rel=0.1)


def test_any_loss_between_meshes_will_do():
    source, target = pair(10.0)
    found = deform(source, target, meshot.chamfer, **DEFORMING_QUICK)
    assert float(meshot.chamfer(found.mesh, target)) < 0.3 * float(meshot.chamfer(source, target))


def test_single_precision_stays(capsys):
    found = deform(*pair(1.0, torch.float32), n_iterations=2, detail=0.3)
    assert found.mesh.vertices.dtype == torch.float32
    assert found.carry(found.mesh.vertices).dtype == torch.float32
    assert "deform" in capsys.readouterr().err
    deform(*pair(1.0, torch.float32), n_iterations=2, detail=0.3, progress=False)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("loss", [None, meshot.chamfer, lambda mesh, target: meshot.wasserstein(mesh, target)])
def test_a_mesh_stays_where_no_step_lowers_the_loss(loss):
    """At equality the gradient of a transport loss in the weights is not unique: Adam would follow rounding."""
    source = cube()
    found = deform(source, source, loss, **DEFORMING_QUICK | {"n_iterations": 3})
    assert torch.equal(found.mesh.vertices, source.vertices)
    assert torch.equal(found.carry(source.vertices), source.vertices)


def test_a_mesh_does_not_go_away_from_its_target():
    """A loss that rises with every motion, and whose gradient at the start is not zero, leaves the source in place."""
    source, target = pair(1.0)

    def kinked(mesh, target):
        way = (mesh.vertices - source.vertices)[:, 0].sum()
        return 1 + torch.where(way > 0, way, -3 * way)

    found = deform(source, target, kinked, **DEFORMING_QUICK | {"n_iterations": 1})
    assert torch.equal(found.mesh.vertices, source.vertices)


@pytest.mark.filterwarnings("error:the deformation is doubtful")
def test_a_coarse_target_is_as_good_as_a_fine_one():
    """A box of 12 faces, and the same box of 768. Without division the coarse one ends far away."""
    coarse = cube(1.4)
    fine = Mesh(*functools.reduce(lambda parts, _: split_in_four(*parts), range(3), (coarse.vertices, coarse.faces)))
    found = [deform(icosphere(3), target, n_iterations=100, detail=0.15, progress=False) for target in (coarse, fine)]
    there = [distance(each.mesh, fine) for each in found]
    assert there[0] < 1.2 * there[1] < 0.05
    assert found[0].distance == pytest.approx(there[0], rel=0.1)
    assert found[0].doubts == ()


def test_edges_are_halved_until_all_are_short():
    mesh = cube(1.0)
    rounds = edge_splits(mesh, 0.3)
    fine = functools.reduce(with_edges_split, rounds, mesh)
    assert float(edge_lengths(fine).max()) <= 0.3
    assert [float(f(fine)) for f in (signed_volume, lambda m: face_areas(m).sum())] == pytest.approx([1, 6], rel=1e-12)
    assert edge_splits(mesh, 1.5) == []
    refuses("longest is 0", edge_splits, mesh, 0)


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        (lambda: (icosphere(1), Mesh.from_trimesh(trimesh.creation.torus(1.0, 0.3))), r"topology.*=2.*euler_number=0"),
        (lambda: (cube(1.0), icosphere(2, 2.0)), "from the target on average"),
        (lambda: (crossing(), crossing()), "faces of the result intersect"),
    ],
)
def test_a_doubtful_result_says_why(pair, words):
    quick, (source, target) = {"n_iterations": 2, "detail": 0.3, "progress": False}, pair()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = deform(source, target, allow_crossings="intersect" in words, **quick)
    assert any(re.search(words, doubt) for doubt in found.doubts)
    assert [str(each.message).partition("doubtful: ")[2] for each in caught] == list(found.doubts)


def test_a_scaled_field_is_the_same_field():
    field = grid_around(cube().vertices, spacings=(0.8, 0.4), margin=0.3)
    with torch.no_grad():
        for level in field.levels:
            level.copy_(torch.from_numpy(np.random.default_rng(0).normal(size=level.shape)))
    shift = torch.tensor([3.0, -5.0, 7.0], dtype=torch.float64)
    time, points = torch.tensor(0.3, dtype=torch.float64), cube(1.7).vertices
    scaled = field.scaled(40.0, shift)(time, points * 40 + shift)
    torch.testing.assert_close(scaled, 40 * field(time, points), rtol=1e-11, atol=1e-11)


def crossing() -> Mesh:
    """Two cubes that overlap."""
    return united([cube(), cube().with_vertices(cube().vertices + 0.5)])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"source": trimesh.creation.box()}, r"source is a Trimesh; a meshot\.Mesh is needed.*from_trimesh"),
        ({"target": None}, "target is a NoneType; a meshot.Mesh"),
        ({"target": cube().to(torch.float32)}, "both must agree"),
        ({"source": crossing()}, "faces cross before the fit begins"),
        ({"detail": 0.0}, r"detail is 0.0; a share in \(0, 1\)"),
        ({"n_iterations": 0}, "n_iterations is 0"),
        ({"loss": lambda mesh, target: 3.0}, "the loss returned 3.0; one number with a gradient"),
        ({"loss": lambda mesh, target: mesh.vertices}, "one number with a gradient"),
        ({"loss": lambda mesh, target: mesh.vertices.sum() * torch.inf}, "the loss of the source is"),
        ({"source": cube().with_vertices(cube().vertices * 0), "target": cube().with_vertices(cube().vertices * 0)},
         "are one point"),
    ],
)  # fmt: skip
def test_what_it_cannot_do_is_refused(unchecked, change, words):
    refuses(words, deform, **{"source": cube(), "target": cube(2.0), **DEFORMING_QUICK} | change)


def test_crossings_may_be_allowed():
    assert deform(crossing(), cube(2.0), allow_crossings=True, **DEFORMING_QUICK | {"n_iterations": 2}).n_steps > 0
