"""Every loss in a training loop: batches, padding, compilers, transforms, autocast, gradient penalties, workers."""

import functools

import pytest
import torch
from torch.utils.data import DataLoader, Dataset

import meshot
from meshot import MeasureBatch, Mesh
from meshot.loss import (
    controlled_sliced_wasserstein,
    energy_sliced_wasserstein,
    hilbert_transport,
    max_sliced_wasserstein,
    min_sliced_transport,
    plain_sliced_wasserstein,
    slice_costs,
    sliced_partial,
    sliced_unbalanced,
    unbalanced_sliced,
    varifold_kernel,
)
from meshot.mesh.shapes import icosphere
from refusals import refuses

LINES = meshot.random_directions(6, 3, 0)
LOSSES = {
    "sliced": functools.partial(meshot.sliced_wasserstein, directions=LINES),
    "plain": functools.partial(plain_sliced_wasserstein, directions=LINES),
    "costs": lambda x, y: slice_costs(x, y, LINES).sum(dim=-1),
    "windowed": functools.partial(
        meshot.windowed_sliced_wasserstein,
        centres=torch.tensor([[0.0, 0, 0], [0.5, 0, 0]]).double(),
        radius=1.0,
        directions=4,
    ),
    "chamfer": meshot.chamfer,
    "brute chamfer": functools.partial(meshot.chamfer, neighbours="brute"),
    "wasserstein": meshot.wasserstein,
    "sinkhorn": functools.partial(meshot.sinkhorn_divergence, blur=0.3),
    "partial": functools.partial(sliced_partial, reach=1.0, directions=LINES),
    "unbalanced": functools.partial(sliced_unbalanced, reach=1.0, directions=LINES),
    "one unbalanced": functools.partial(unbalanced_sliced, reach=5.0, directions=LINES),
    "kernel": functools.partial(varifold_kernel, width=1.0),
    "max": functools.partial(max_sliced_wasserstein, directions=LINES, n_steps=0),
    "energy": functools.partial(energy_sliced_wasserstein, directions=LINES),
    "controlled": functools.partial(controlled_sliced_wasserstein, directions=LINES, control="upper"),
    "lifted": functools.partial(min_sliced_transport, directions=LINES),
    "curve": hilbert_transport,
}
each = pytest.mark.parametrize("name", LOSSES)
#: Losses whose gradient has no derivative, and those whose gradient holds something constant by definition.
ONCE, HELD = {"sinkhorn", "partial", "unbalanced", "one unbalanced", "max"}, {"windowed"}


def clouds(name, n_clouds=3, n=9, seed=0, dtype=torch.float64):
    """A batch of clouds, in the dimension of the loss."""
    random = torch.Generator().manual_seed(seed)
    return torch.randn(n_clouds, n, 6 if name == "kernel" else 3, generator=random, dtype=torch.float64).to(dtype)


def slope(loss, points, target, **options):
    """The gradient of the sum of the values, by each point."""
    (found,) = torch.autograd.grad(loss(points, target).sum(), points, **options)
    return found


@pytest.fixture(params=[1, 2])
def threads(request):
    """One thread for all pairs, or a pair on each."""
    before = torch.get_num_threads()
    torch.set_num_threads(request.param)
    yield
    torch.set_num_threads(before)


@each
def test_a_batch_has_the_values_and_gradients_of_a_loop(name, threads):
    loss, x, y = LOSSES[name], clouds(name).requires_grad_(), clouds(name, n=7, seed=1)
    values = loss(x, y)
    assert values.shape == (3,)
    torch.testing.assert_close(values, torch.stack([loss(a, b) for a, b in zip(x, y)]), rtol=1e-12, atol=0)
    alone = torch.stack([slope(loss, a.detach().requires_grad_(), b) for a, b in zip(x, y)])
    torch.testing.assert_close(slope(loss, x, y), alone, rtol=1e-12, atol=1e-15)
    torch.testing.assert_close(loss(x.detach().numpy(), y.numpy()), values.detach(), rtol=1e-12, atol=0)
    if name != "costs":
        torch.testing.assert_close(loss(x, y, reduction="mean"), values.mean(), rtol=1e-12, atol=0)
        refuses("reduction is 'sum'; one of none, mean", loss, x, y, reduction="sum")
    # A weight in front of each value reaches the gradient of its own pair only.
    (found,) = torch.autograd.grad(loss(x, y) @ torch.tensor([0.0, 2.0, 0.0]).double(), x)
    torch.testing.assert_close(found[1], 2 * alone[1], rtol=1e-12, atol=1e-15)
    assert not bool(found[[0, 2]].any())


@each
def test_lists_and_padding_mean_the_clouds_alone(name):
    """Padding of mass zero lies far away; padding beyond a length may be anything."""
    loss, x, y, sizes = LOSSES[name], clouds(name), clouds(name, n=7, seed=1), [4, 9, 6]
    apart = [cloud[:size].clone().requires_grad_() for cloud, size in zip(x, sizes)]
    expected = torch.stack([loss(cloud, other) for cloud, other in zip(apart, y)])
    slopes = torch.autograd.grad(expected.sum(), apart)
    torch.testing.assert_close(loss(apart, list(y)), expected, rtol=1e-12, atol=0)
    inside = torch.arange(9) < torch.tensor(sizes)[:, None]
    for filling, how in ((1e3, "weights"), (0.0, "weights"), (torch.nan, "lengths")):
        points = torch.where(inside[..., None], x, filling).requires_grad_()
        masses = inside / inside.sum(dim=1, keepdim=True).double()
        batch = MeasureBatch(points, masses) if how == "weights" else MeasureBatch(points, lengths=torch.tensor(sizes))
        found = loss(batch, y)
        torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-12)
        (gradient,) = torch.autograd.grad(found.sum(), points)
        assert float(gradient[~inside].abs().max()) < 1e-9
        for own, alone, size in zip(gradient, slopes, sizes):
            torch.testing.assert_close(own[:size], alone, rtol=1e-7, atol=1e-9)


@each
def test_one_measure_beside_a_batch_belongs_to_every_pair(name):
    loss, x, y = LOSSES[name], clouds(name), clouds(name, n=7, seed=1)[0]
    torch.testing.assert_close(loss(x, y), torch.stack([loss(a, y) for a in x]), rtol=1e-12, atol=0)
    torch.testing.assert_close(loss(y, x), torch.stack([loss(y, a) for a in x]), rtol=1e-12, atol=0)


@pytest.mark.parametrize("name", sorted(set(LOSSES) - HELD - {"one unbalanced", "sinkhorn"}))
def test_gradients_of_a_batch_are_those_of_differences(name):
    """Not of the two that stop before they have converged."""
    x, y = (clouds(name, 2, 4, seed).requires_grad_() for seed in (0, 1))
    assert torch.autograd.gradcheck(LOSSES[name], (x, y), fast_mode=True)


@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor")  # the compiler's own, of tensors between graphs
@each
def test_a_compiled_step_has_the_same_result(name):
    loss, x, y = LOSSES[name], clouds(name).requires_grad_(), clouds(name, n=7, seed=1)

    def step(points):
        return loss(1.5 * points, y).mean()

    compiled = torch.compile(step, backend="eager")(x)
    assert torch.equal(compiled, step(x))
    assert torch.equal(*(torch.autograd.grad(value, x)[0] for value in (compiled, step(x))))


@each
def test_transforms_are_refused_with_the_remedy(name):
    loss, x, y = LOSSES[name], clouds(name), clouds(name, seed=1)
    words = r"within a transform of torch\.func.*\(B, n, d\) tensor"
    refuses(words, torch.vmap(loss), x, y)
    refuses(words, torch.func.grad(lambda points: loss(points, y[0])), x[0])


@each
@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_computed_in_single(name, dtype):
    """In mm, where squares exceed float16. The gradient has the dtype that came."""
    loss, scale = LOSSES[name], 1.0 if name in ("kernel", "windowed", "one unbalanced") else 300.0
    x, y = (scale * clouds(name, n=7, seed=seed) for seed in (0, 1))
    x, y = x.to(dtype).requires_grad_(), y.to(dtype)
    value = loss(x, y)
    assert value.dtype == torch.float32
    torch.testing.assert_close(value, loss(x.float(), y.float()), rtol=1e-6, atol=0)
    torch.testing.assert_close(loss(x[0], y[0]), value[0], rtol=1e-6, atol=0)
    assert slope(loss, x, y).dtype == dtype
    assert bool(torch.isfinite(slope(loss, x, y)).all()) or dtype == torch.float16


@each
def test_single_precision_has_the_values_and_gradients_of_double(name):
    loss, x, y = LOSSES[name], clouds(name).requires_grad_(), clouds(name, n=7, seed=1)
    single = x.detach().float().requires_grad_()
    values, found = loss(single, y.float()), slope(loss, single, y.float())
    assert values.dtype == found.dtype == torch.float32
    torch.testing.assert_close(values.double(), loss(x, y), rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(found.double(), slope(loss, x, y), rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", ["sliced", "windowed", "partial", "unbalanced", "kernel"])
def test_any_number_of_threads_gives_the_same_bits(name, monkeypatch):
    """Also in small groups of work. The clouds are wide, so that the kernel norm leaves out pairs of blocks."""
    x, y = (15 * clouds(name, 1, n, seed)[0] for n, seed in ((900, 0), (800, 1)))
    masses = torch.rand(900, generator=torch.Generator().manual_seed(0)).double()
    loss = LOSSES[name]
    if name == "windowed":
        loss = functools.partial(meshot.windowed_sliced_wasserstein, centres=x[:13], radius=10.0, directions=4)
    for place in ("sliced._ALONE", "windowed._ALONE", "windowed._AHEAD"):
        monkeypatch.setattr(f"meshot.loss.{place}", 1)
    before, found = torch.get_num_threads(), []
    for n_threads, group in ((1, 1 << 19), (2, 200), (3, 1), (8, 200)):
        monkeypatch.setattr("meshot.loss.sliced._GROUP", group)
        monkeypatch.setattr("meshot.loss.sliced._GROUP_OF_MANY", group)
        tensors = [x.clone().requires_grad_(), (masses / masses.sum()).requires_grad_()]
        torch.set_num_threads(n_threads)
        value = loss(meshot.DiscreteMeasure(*tensors), y)
        torch.set_num_threads(before)
        found.append([value, *torch.autograd.grad(value, tensors)])
    assert all(torch.equal(*pair) for others in found[1:] for pair in zip(others, found[0], strict=True))


@each
def test_autocast_does_not_narrow_a_loss(name):
    layer, y = torch.nn.Linear(3, 6 if name == "kernel" else 3), clouds(name, n=7, seed=1, dtype=torch.float32)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        made = layer(torch.ones(3, 9, 3) * torch.arange(9)[:, None] / 9)
        value = LOSSES[name](made, y).mean()
    assert (made.dtype, value.dtype) == (torch.bfloat16, torch.float32)
    assert float(value.detach()) == float(LOSSES[name](made.float(), y).mean().detach())
    value.backward()
    assert float(layer.weight.grad.norm()) > 0


@each
def test_a_penalty_on_the_gradient_is_right_or_refused(name):
    loss, x, y = LOSSES[name], clouds(name).requires_grad_(), clouds(name, n=7, seed=1)
    first = slope(loss, x, y, create_graph=True)
    torch.testing.assert_close(first, slope(loss, x, y), rtol=1e-10, atol=1e-14)
    if name in ONCE:
        with pytest.raises(ValueError, match="no second derivatives"):
            first.square().sum().backward()
        return
    (found,) = torch.autograd.grad(first.square().sum(), x)
    if name in HELD:  # the weights of windows are constant, so that PyTorch's own way is the standard
        lines = torch.stack([meshot.quasi_directions(4, 3, seed) for seed in (0, 1)]).requires_grad_()
        plain = slope(functools.partial(loss, directions=lines), x, y, create_graph=True)
        torch.testing.assert_close(found, torch.autograd.grad(plain.square().sum(), x)[0], rtol=1e-9, atol=1e-12)
        return
    way, step = clouds(name, seed=2), 1e-6
    ends = [slope(loss, (x + s * way).detach().requires_grad_(), y).square().sum() for s in (step, -step)]
    assert float((found * way).sum()) == pytest.approx(float(ends[0] - ends[1]) / (2 * step), rel=1e-5)


class Values(Dataset):
    """The loss of one pair, computed where the item is loaded."""

    def __init__(self, name):
        self.name = name

    def __len__(self):
        return 2

    def __getitem__(self, k):
        return LOSSES[self.name](clouds(self.name)[k], clouds(self.name, seed=1)[k])


@each
def test_a_worker_of_a_loader_computes_the_same(name):
    here = torch.stack([Values(name)[k] for k in range(2)])
    (there,) = DataLoader(Values(name), batch_size=2, num_workers=1)
    assert torch.equal(here, there)


def test_distributed_training_takes_a_step(tmp_path):
    """One process is enough to see the gradients pass through the hooks of DDP."""
    torch.distributed.init_process_group("gloo", init_method=f"file://{tmp_path / 'store'}", rank=0, world_size=1)
    try:
        layer, x, y = torch.nn.Linear(3, 3).double(), clouds("sliced"), clouds("sliced", seed=1)
        (expected,) = torch.autograd.grad(meshot.sliced_wasserstein(layer(x), y, LINES).mean(), layer.weight)
        meshot.sliced_wasserstein(torch.nn.parallel.DistributedDataParallel(layer)(x), y, LINES).mean().backward()
        torch.testing.assert_close(layer.weight.grad, expected)
    finally:
        torch.distributed.destroy_process_group()


# Meshes: of unequal size, in a list, by their continuous measure.


def test_meshes_of_unequal_size_are_a_batch(threads):
    source, target = (
        [icosphere(0), icosphere(1, 1.2), icosphere(0, 0.9)],
        [icosphere(1, 1.5), icosphere(0), icosphere(0)],
    )
    moving = [Mesh(mesh.vertices.clone().requires_grad_(), mesh.faces) for mesh in source]
    for loss in (functools.partial(meshot.sliced_wasserstein, directions=LINES), meshot.chamfer):
        values = loss(moving, target)
        alone = torch.stack([loss(s, t) for s, t in zip(moving, target)])
        torch.testing.assert_close(values, alone, rtol=1e-12, atol=0)
        pairs = zip(*(torch.autograd.grad(v.sum(), [m.vertices for m in moving]) for v in (values, alone)))
        for found, expected in pairs:
            torch.testing.assert_close(found, expected, rtol=1e-12, atol=1e-14)
    half = [mesh.with_vertices(mesh.vertices.half()) for mesh in source]
    assert meshot.chamfer(half, half).dtype == torch.float32
    (first,) = torch.autograd.grad(
        meshot.sliced_wasserstein(moving, target, LINES).sum(), moving[0].vertices, create_graph=True
    )
    with pytest.raises(ValueError, match="no second derivatives"):
        first.square().sum().backward()


# Seeds, and what is refused.


def test_a_seed_draws_other_directions():
    x, y = clouds("sliced")[0], clouds("sliced", seed=1)[0]
    first = meshot.sliced_wasserstein(x, y, 10, seed=3)
    assert float(first) == float(meshot.sliced_wasserstein(x, y, meshot.quasi_directions(10, 3, 3)))
    draw = torch.Generator().manual_seed(0)
    drawn = {float(meshot.sliced_wasserstein(x, y, 10, seed=draw)) for _ in range(3)}
    assert len(drawn) == 3
    centres = x[:2]
    sets = torch.stack([meshot.quasi_directions(10, 3, seed) for seed in (6, 7)])
    windowed = meshot.windowed_sliced_wasserstein
    assert float(windowed(x, y, centres, 3.0, 10, seed=3)) == float(windowed(x, y, centres, 3.0, sets))
    refuses("seed is 3 beside directions of shape", meshot.sliced_wasserstein, x, y, LINES, seed=3)
    refuses("generator is -1", meshot.sliced_wasserstein, x, y, 10, seed=-1)


def test_windows_may_differ_between_pairs():
    x, y = clouds("windowed"), clouds("windowed", seed=1)
    own = [cloud[: k + 1] for k, cloud in enumerate(x)]
    found = meshot.windowed_sliced_wasserstein(x, y, own, 1.5, 4)
    alone = [meshot.windowed_sliced_wasserstein(a, b, c, 1.5, 4) for a, b, c in zip(x, y, own)]
    torch.testing.assert_close(found, torch.stack(alone), rtol=1e-12, atol=0)
    refuses("centres holds 2 sets; 3 are needed", meshot.windowed_sliced_wasserstein, x, y, own[:2], 1.5, 4)


def test_bad_batches_are_refused(unchecked):
    x = clouds("chamfer")
    refuses("source holds 3 measures and target 2; as many on both sides", meshot.chamfer, x, x[:2])
    refuses(r"source\[1\] is None; a measure", meshot.chamfer, [x[0], None], x[:2])
    refuses(r"pair 1 of the batch is in R\^2", meshot.chamfer, [x[0], x[1, :, :2]], [x[0], x[1, :, :2]])
    refuses("points has shape .*none of them zero", MeasureBatch, x[:0])
    refuses("weights and lengths are both given", MeasureBatch, x, torch.ones(3, 9) / 9, [9, 9, 9])
    refuses("the least entry 0", MeasureBatch, x, lengths=[3, 0, 9])
    refuses("lengths holds indices from 3 to 10", MeasureBatch, x, lengths=[3, 10, 9])
    refuses("row 1 of weights sums to 2", MeasureBatch, x, torch.tensor([[1.0], [2.0], [1.0]]).expand(3, 9) / 9)
    refuses("weights has a negative entry", MeasureBatch, x, -torch.ones(3, 9) / 9)
    refuses(r"weights has shape \(3, 8\)", MeasureBatch, x, torch.ones(3, 8) / 8)
    refuses("points has 1 entries that are NaN", MeasureBatch, torch.where(x == x[0, 0, 0], torch.nan, x))


def test_weights_of_a_batch_are_normalised_and_keep_their_gradient():
    x, raw = clouds("sliced"), torch.rand(3, 9).double().requires_grad_()
    weights = raw / raw.sum(dim=1, keepdim=True)
    batch = MeasureBatch(x, (weights * (1 + 5e-6)).float())
    assert batch.weights.dtype == torch.float64
    torch.testing.assert_close(batch.weights.sum(dim=1), torch.ones(3).double(), rtol=1e-14, atol=0)
    meshot.sliced_wasserstein(MeasureBatch(x, weights), x, LINES).sum().backward()
    assert float(raw.grad.norm()) > 0
    assert repr(batch.to(torch.float32)) == "MeasureBatch(3 measures of up to 9 points in R^3, torch.float32)"
    assert len(batch) == 3


def test_a_value_beyond_the_dtype_is_refused():
    x = 1e160 * clouds("sliced")
    refuses("exceeds the range of torch.float64", meshot.sliced_wasserstein, x, -x, LINES)
