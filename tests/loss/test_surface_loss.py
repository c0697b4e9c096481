"""The loss by name is the loss by hand."""

import dataclasses
import functools

import numpy as np
import pytest
import torch

from meshot import (
    chamfer,
    empirical,
    sinkhorn_divergence,
    sliced_wasserstein,
    surface,
    varifold,
    windowed_sliced_wasserstein,
)
from meshot.loss import sliced_partial, sliced_unbalanced, varifold_kernel
from meshot.loss.composed import (
    ENCODINGS,
    LOSSES,
    SampleEncoding,
    SummedLoss,
    SurfaceLoss,
    loss_setting_names,
    surface_loss,
)
from meshot.loss.directions import random_directions
from meshot.measure.discrete import varifold_sample
from meshot.mesh.shapes import icosphere
from refusals import refuses

SOURCE, TARGET = icosphere(2, 10.0), icosphere(3, 12.0, centre=(1.0, 0.0, 0.0))


def random() -> np.random.Generator:
    return np.random.default_rng(5)


def in_windows(source, target, draw):
    """Every window has its directions, and lies on the target."""
    goal, lines = varifold(target, normal_scale=3.0), random_directions(4 * 10, 6, draw).reshape(4, 10, 6)
    centres = goal.points[draw.choice(len(goal.weights), 4, p=goal.weights.numpy()), :3]
    return windowed_sliced_wasserstein(varifold(source, normal_scale=3.0), goal, centres, 5.0, lines, 1)


def of_varifolds(loss, *options, n_directions=0):
    """A loss between varifolds, with options, and directions last."""

    def by_hand(source, target, draw):
        lines = [random_directions(n_directions, 6, draw)] if n_directions else []
        return loss(varifold(source, normal_scale=3.0), varifold(target, normal_scale=3.0), *options, *lines)

    return by_hand


def of_samples(loss, n_points):
    """A loss between points of both surfaces, drawn one after the other."""
    return lambda source, target, draw: loss(empirical(source, n_points, draw), empirical(target, n_points, draw))


def of_drawn_faces(source, target, draw):
    drawn = [varifold_sample(mesh, 200, draw, normal_scale=2.0, detach_weights=True) for mesh in (source, target)]
    return chamfer(*drawn)


def of_surfaces(source, target, draw):
    return sliced_wasserstein(surface(source), surface(target), random_directions(20, 3, draw), 1)


#: Settings, and the loss that they name. The first two are those of DDOT and of CortexODE.
BY_HAND = [
    ({"normal_scale": 3.0}, of_varifolds(sliced_wasserstein, n_directions=100)),
    ({"loss": "chamfer", "encoding": "samples", "factor": 1000.0}, of_samples(chamfer, 320)),
    ({"loss": "chamfer", "n_supports": 200, "normal_scale": 2.0, "detach_weights": True}, of_drawn_faces),
    ({"loss": "sinkhorn", "encoding": "samples", "n_supports": 50, "blur": 1.0, "scaling": 0.6},
     of_samples(functools.partial(sinkhorn_divergence, p=2, blur=1.0, scaling=0.6), 50)),
    ({"encoding": "surface", "n_directions": 20, "p": 1}, of_surfaces),
    ({"loss": "windowed", "normal_scale": 3.0, "window": 5.0, "n_windows": 4, "n_directions": 10, "p": 1}, in_windows),
    ({"loss": "sliced_partial", "normal_scale": 3.0, "reach": 3.0, "n_directions": 7},
     of_varifolds(sliced_partial, 3.0, n_directions=7)),
    ({"loss": "sliced_unbalanced", "normal_scale": 3.0, "reach": 3.0, "n_directions": 7},
     of_varifolds(sliced_unbalanced, 3.0, n_directions=7)),
    ({"loss": "varifold_kernel", "normal_scale": 3.0, "width": 3.0, "angular": "currents"},
     of_varifolds(varifold_kernel, 3.0, "currents")),
]  # fmt: skip


@pytest.mark.parametrize(("settings", "by_hand"), BY_HAND)
def test_the_loss_by_name_is_the_loss_by_hand(settings, by_hand):
    found = float(surface_loss(settings)(SOURCE, TARGET, random()))
    wanted = settings.get("factor", 1) * float(by_hand(SOURCE, TARGET, random()))
    assert found == pytest.approx(wanted, rel=1e-9)


def test_the_radius_of_windows_falls_over_a_training():
    falling = surface_loss({"loss": "windowed", "window": 6.0, "last_window": 1.5, "n_windows": 4})
    radii = [falling.at(done).loss.window for done in (0.0, 0.5, 1.0)]
    assert radii == pytest.approx([6.0, 3.0, 1.5], rel=1e-12)
    half = surface_loss({"loss": "windowed", "window": 3.0, "n_windows": 4})
    in_a_sum = surface_loss({"terms": [falling.settings(), {"loss": "chamfer"}]}).at(0.5)
    chamfer = surface_loss({"loss": "chamfer"})
    expected = float(half(SOURCE, TARGET, random()) + chamfer(SOURCE, TARGET, random()))
    assert float(in_a_sum(SOURCE, TARGET, random())) == pytest.approx(expected, rel=1e-12)
    for unchanged in (half, chamfer):
        assert unchanged.at(0.5) == unchanged


@pytest.mark.parametrize("encoding", ["varifold", "samples", "surface"])
def test_the_gradient_reaches_the_vertices_in_their_own_precision(encoding):
    vertices = SOURCE.vertices.float().requires_grad_()
    loss = surface_loss({"encoding": encoding})(SOURCE.with_vertices(vertices), TARGET.to(torch.float32), random())
    (gradient,) = torch.autograd.grad(loss, vertices)
    assert gradient.dtype == torch.float32
    assert float(gradient.norm()) > 0


def test_masses_of_samples_carry_a_gradient_if_asked():
    def gradient(loss):
        vertices = SOURCE.vertices.clone().requires_grad_()
        return torch.autograd.grad(loss(SOURCE.with_vertices(vertices)), vertices)[0]

    def by_hand(mesh, detach_weights):
        draw = random()
        pair = [empirical(each, 40, draw, detach_weights=detach_weights) for each in (mesh, TARGET)]
        return sliced_wasserstein(*pair, random_directions(100, 3, draw))

    for settings, detached in (({}, True), ({"detach_weights": True}, True), ({"detach_weights": False}, False)):
        loss = surface_loss({"encoding": "samples", "n_supports": 40} | settings)
        found = gradient(lambda mesh, loss=loss: loss(mesh, TARGET, random()))
        assert torch.equal(found, gradient(lambda mesh, d=detached: by_hand(mesh, d)))
        assert not torch.equal(found, gradient(lambda mesh, d=detached: by_hand(mesh, not d)))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"loss": "hausdorff"}, "loss is 'hausdorff'; one of sliced, windowed, chamfer, sinkhorn"),
        ({"encoding": "mesh"}, "encoding is 'mesh'; one of varifold, samples, surface"),
        ({"p": 3}, "p is 3; one of 1, 2"),
        ({"loss": "sinkhorn", "p": 3}, "p is 3; one of 1, 2"),
        ({"loss": "chamfer", "encoding": "surface"}, "does not accept .*; sliced does"),
        ({"loss": "windowed", "encoding": "surface"}, "does not accept .*, which has no support points"),
        ({"encoding": "surface", "n_supports": 10}, "n_supports is set, which sliced on surface does not use"),
        ({"encoding": "samples", "normal_scale": 1.0}, "normal_scale is set, which sliced on samples does not use"),
        ({"encoding": "surface", "detach_weights": True}, "detach_weights is set, which sliced on surface does not"),
        ({"loss": "chamfer", "p": 1}, "p is set, which chamfer on varifold does not use; it uses n_supports, normal_"),
        ({"window": 5.0}, "window is set, which sliced on varifold does not use"),
        ({"n_directions": 0}, "n_directions is 0"),
        ({"n_supports": 0}, "n_supports is 0"),
        ({"encoding": "samples", "n_supports": 0}, "n_supports is 0"),
        ({"factor": 0.0}, "factor is 0.0"),
        ({"loss": "sinkhorn", "blur": float("inf")}, "blur is inf"),
        ({"loss": "sinkhorn", "scaling": 1.0}, "scaling is 1.0"),
        ({"normal_scale": -1.0}, "normal_scale is -1.0"),
        ({"loss": "windowed", "window": 0.0}, "window is 0.0; a finite number > 0"),
        ({"loss": "windowed", "n_windows": 0}, "n_windows is 0"),
        ({"loss": "windowed", "last_window": -3.0}, "last_window is -3.0; a finite number > 0"),
        ({"loss": "sliced_partial", "reach": -1.0}, "reach is -1"),
        ({"loss": "sliced_unbalanced", "reach": -1.0}, "reach is -1"),
        ({"terms": []}, "terms is empty"),
        ({"terms": "chamfer"}, "terms is 'chamfer'; a list of settings"),
        ({"terms": [{"terms": []}]}, "a list of settings of losses is needed"),
        ({"terms": [{"loss": "chamfer"}], "factor": 2.0}, "factor stands beside terms"),
        ({"terms": [{"loss": "chamfer", "p": 1}]}, "p is set, which chamfer"),
    ],
)
def test_settings_that_will_not_do(settings, words):
    refuses(words, surface_loss, settings)


@pytest.mark.parametrize("encoding", ["varifold", "samples"])
def test_a_switch_is_true_or_false(encoding, unchecked):
    refuses("detach_weights is 1; true or false is needed", surface_loss, {"encoding": encoding, "detach_weights": 1})


def test_a_sum_has_terms_with_encodings_of_their_own():
    terms = [{"loss": "windowed", "normal_scale": 3.0, "n_windows": 4}, {"loss": "chamfer", "encoding": "samples"}]
    terms[1]["factor"] = 0.1
    together, draw = surface_loss({"terms": terms}), random()
    one_by_one = [surface_loss(term)(SOURCE, TARGET, draw) for term in terms]
    assert float(together(SOURCE, TARGET, random())) == pytest.approx(float(sum(one_by_one)), rel=1e-12)
    assert isinstance(together, SummedLoss)
    assert surface_loss(together.settings()) == together
    assert together.settings().keys() <= loss_setting_names()


#: Surfaces suit some losses only, and points without normals not the kernel norm.
COMBINED = [
    (encoding, loss)
    for encoding in ENCODINGS
    for loss, kind in LOSSES.items()
    if (encoding != "surface" or kind.takes_continuous) and (encoding, loss) != ("samples", "varifold_kernel")
]


@pytest.mark.parametrize(("encoding", "loss"), COMBINED)
def test_lists_of_meshes_are_a_batch(loss, encoding):
    """With the directions of all pairs drawn once. Windows have directions of their own, drawn after the points."""
    settings = {"loss": loss, "encoding": encoding, "factor": 2.0} | ({"n_windows": 4} if loss == "windowed" else {})
    settings |= {"n_supports": 30} if encoding == "samples" else {}
    settings |= {"normal_scale": 1.0} if loss == "varifold_kernel" and encoding == "varifold" else {}
    made, moving = surface_loss(settings), icosphere(1, 10.0).vertices.requires_grad_()
    pairs = [(icosphere(1).with_vertices(moving), TARGET), (SOURCE, icosphere(1, 11.0)), (TARGET, SOURCE)]
    sources, targets = map(list, zip(*pairs, strict=True))
    values = made(sources, targets, random())
    assert values.shape == (3,)
    draw = random()
    measures = [[made.encoding.measure(mesh, len(s.faces), draw) for mesh in (s, t)] for s, t in pairs]
    if loss == "windowed":
        expected = torch.stack([made.loss(*pair, draw) for pair in measures])
    else:
        after = draw.bit_generator.state
        expected = []
        for pair in measures:
            draw.bit_generator.state = after
            expected.append(made.loss(*pair, draw))
        expected = torch.stack(expected)
    torch.testing.assert_close(values, 2 * expected, rtol=1e-12, atol=0)
    mean = made(sources, targets, random(), reduction="mean")
    torch.testing.assert_close(mean, values.mean(), rtol=1e-12, atol=0)
    (gradient,) = torch.autograd.grad(mean, moving)
    torch.testing.assert_close(gradient, torch.autograd.grad(2 * expected.mean(), moving)[0], rtol=1e-9, atol=1e-14)


def test_a_mesh_beside_a_list_belongs_to_every_pair_and_sums_of_losses_take_lists():
    together = surface_loss({"terms": [{"normal_scale": 3.0}, {"loss": "chamfer", "factor": 0.1}]})
    meshes = [SOURCE, icosphere(1, 11.0)]
    found = together(meshes, TARGET, random())
    alone = torch.stack([together(mesh, TARGET, random()) for mesh in meshes])
    torch.testing.assert_close(found, alone, rtol=1e-12, atol=0)
    torch.testing.assert_close(together(meshes, TARGET, random(), reduction="mean"), alone.mean(), rtol=1e-12, atol=0)
    half = SOURCE.with_vertices(SOURCE.vertices.half())
    found = SurfaceLoss()([half], TARGET.to(torch.float32), random())
    assert float(found) == float(SurfaceLoss()(half.to(torch.float32), TARGET.to(torch.float32), random()))
    assert found.dtype == torch.float32


def test_batches_that_will_not_do(unchecked):
    refuses("source holds 2 measures and target 3", SurfaceLoss(), [SOURCE] * 2, [TARGET] * 3, random())
    refuses(
        "target of pair 1 is a Tensor; a Mesh or a list", SurfaceLoss(), SOURCE, [TARGET, torch.ones(4, 3)], random()
    )
    refuses("source is an empty list", SurfaceLoss(), [], TARGET, random())
    refuses("reduction is 'sum'", SurfaceLoss(), [SOURCE], [TARGET], random(), reduction="sum")


def test_settings_come_back_as_they_went_in():
    for loss in LOSSES:
        for encoding in ENCODINGS:
            if encoding == "surface" and not LOSSES[loss].takes_continuous:
                continue
            made = surface_loss({"loss": loss, "encoding": encoding, "factor": 2.0})
            assert surface_loss(made.settings()) == made
            assert made.settings().keys() <= loss_setting_names()
            assert (made.settings()["loss"], made.settings()["encoding"]) == (loss, encoding)
    assert surface_loss({}) == SurfaceLoss()
    assert surface_loss({"encoding": "samples", "normal_scale": None}) == SurfaceLoss(SampleEncoding())
    fields = [{f.name for f in dataclasses.fields(kind)} for kind in ENCODINGS.values()]
    others = [{f.name for f in dataclasses.fields(kind)} for kind in LOSSES.values()]
    assert not set.union(*fields) & set.union(*others)  # a flat setting belongs to one part
