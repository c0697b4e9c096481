"""What a loss takes: measures of any class, meshes, arrays; and what it says of everything else."""

import dataclasses

import numpy as np
import pytest
import pyvista
import torch
import trimesh

import meshot
import problems
from meshot import DiscreteMeasure, SurfaceMeasure, quasi_directions, random_directions, surface, varifold
from meshot.measure import Measure
from meshot.mesh.mesh import closed_contour
from meshot.mesh.shapes import cube, icosphere, star
from refusals import refuses

LINES = random_directions(20, 3, 0)
CENTRES = torch.zeros(1, 3, dtype=torch.float64)
#: Every loss, and whether it compares points.
LOSSES = {
    "sliced_wasserstein": (lambda s, t: meshot.sliced_wasserstein(s, t, LINES), False),
    "slice_costs": (lambda s, t: meshot.slice_costs(s, t, LINES).mean(), False),
    "estimate": (lambda s, t: meshot.sliced_wasserstein_estimate(s, t, 20, 0).value, False),
    "chamfer": (meshot.chamfer, True),
    "wasserstein": (meshot.wasserstein, True),
    "sinkhorn_divergence": (meshot.sinkhorn_divergence, True),
    "windowed": (lambda s, t: meshot.windowed_sliced_wasserstein(s, t, CENTRES, 3.0, LINES[None]), True),
    "plain": (lambda s, t: meshot.loss.plain_sliced_wasserstein(s, t, LINES), True),
    "max": (lambda s, t: meshot.loss.max_sliced_wasserstein(s, t, LINES), True),
    "energy": (lambda s, t: meshot.loss.energy_sliced_wasserstein(s, t, LINES), True),
    "controlled": (lambda s, t: meshot.loss.controlled_sliced_wasserstein(s, t, LINES), True),
    "lifted": (lambda s, t: meshot.loss.min_sliced_transport(s, t, LINES), True),
    "curve": (meshot.loss.hilbert_transport, True),
}
each_loss = pytest.mark.parametrize("name", LOSSES)


@dataclasses.dataclass(frozen=True, eq=False)
class Lattice:
    """A toy: equal masses on some corners of the unit cube; it knows nothing of the losses, nor they of it."""

    n: int

    @property
    def places(self) -> torch.Tensor:
        return cube().vertices[: self.n]

    @property
    def weights(self) -> torch.Tensor:
        return torch.full((self.n,), 1 / self.n, dtype=torch.float64)

    @property
    def cells(self) -> None:
        return None


@dataclasses.dataclass(frozen=True, eq=False)
class Polyline:
    """Another toy: mass spread evenly, in equal parts, along each segment of a line through points."""

    places: torch.Tensor

    @property
    def weights(self) -> torch.Tensor:
        return torch.full((len(self.places) - 1,), 1 / (len(self.places) - 1), dtype=torch.float64)

    @property
    def cells(self) -> torch.Tensor:
        first = torch.arange(len(self.places) - 1)
        return torch.stack([first, first + 1], dim=1)


@each_loss
def test_a_third_kind_of_measure_is_taken_by_every_loss(name):
    loss, _ = LOSSES[name]
    other = problems.cloud(1, 9, 3)
    assert isinstance(Lattice(5), Measure)
    assert float(loss(Lattice(5), other)) == float(loss(DiscreteMeasure(cube().vertices[:5]), other))


def test_a_third_kind_of_measure_may_be_continuous():
    path = Polyline(cube().vertices[:4])
    as_known = SurfaceMeasure(path.places, path.cells, path.weights)
    other = problems.cloud(1, 9, 3)
    for name in ("sliced_wasserstein", "slice_costs", "estimate"):
        assert float(LOSSES[name][0](path, other)) == float(LOSSES[name][0](as_known, other))


def test_the_known_measures_are_measures_and_meshes_are_not():
    assert isinstance(problems.cloud(0, 3, 2), Measure)
    assert isinstance(surface(cube()), Measure)
    assert not isinstance(cube(), Measure)


@each_loss
def test_arrays_and_tensors_are_points_of_equal_weight(name):
    loss, _ = LOSSES[name]
    points, others = problems.cloud(0, 12, 3).points, problems.cloud(1, 9, 3).points
    expected = float(loss(DiscreteMeasure(points), DiscreteMeasure(others)))
    assert float(loss(points.numpy(), others)) == expected
    if name != "estimate":
        moving = points.clone().requires_grad_()
        loss(moving, others).backward() if name != "slice_costs" else loss(moving, others).sum().backward()
        assert float(moving.grad.norm()) > 0


@each_loss
def test_a_mesh_is_its_continuous_measure_or_the_barycentres_of_its_faces(name):
    loss, of_points = LOSSES[name]
    mesh, other = icosphere(0), cube()
    encode = varifold if of_points else surface
    assert float(loss(mesh, other)) == float(loss(encode(mesh), encode(other)))


def test_a_contour_is_taken_like_a_mesh():
    ring, other = star(5, 1.5, 0.35), closed_contour(torch.eye(3, 2).double())
    assert float(meshot.sliced_wasserstein(ring, other)) == float(
        meshot.sliced_wasserstein(surface(ring), surface(other))
    )
    assert float(meshot.chamfer(ring, other)) == float(meshot.chamfer(varifold(ring), varifold(other)))


@each_loss
def test_what_compares_points_refuses_a_continuous_measure(name):
    loss, of_points = LOSSES[name]
    if of_points:
        refuses(r"target is a continuous measure, SurfaceMeasure.*meshot\.empirical", loss, cube(), surface(cube()))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (trimesh.creation.box(), r"source is a trimesh\.Trimesh;.*convert it by Mesh\.from_trimesh"),
        (pyvista.Sphere(), r"source is a pyvista\.PolyData;.*convert it by Mesh\.from_pyvista"),
        ([[0.0, 1.0, 2.0]], r"source is a list;.*torch\.tensor"),
        ((np.zeros((3, 3)), np.array([[0, 1, 2]])), r"source is a tuple;.*Mesh\(vertices, faces\)"),
        (None, "source is None; a measure, a Mesh"),
        (3.0, "source is 3.0; a measure"),
        ("mesh.ply", "source is 'mesh.ply'"),
        (np.zeros((4, 3), complex), "source has dtype torch.complex128; floating point is needed: take its .real part"),
        (np.zeros((4, 3), int), r"source has dtype torch.int64; .*an array with \.astype\(float\)"),
        (torch.zeros(4, 3, dtype=torch.long), r"source has dtype torch.int64; .*convert with \.double\(\)"),
        (np.array([["a", "b"]]), "source cannot be made a tensor"),
        (np.zeros(3), r"source has shape \(3,\); \(n, d\) is needed"),
        (np.zeros((0, 3)), "source is empty"),
        (np.full((2, 3), np.nan), "source has 6 entries that are NaN"),
        (np.zeros((4, 3), np.float32), "source is torch.float32 on cpu, target torch.float64"),
        (np.zeros((4, 2)), r"R\^2 and target in R\^3"),
    ],
)
@each_loss
def test_everything_else_is_refused(unchecked, name, value, words):
    refuses(words, LOSSES[name][0], value, problems.cloud(0, 5, 3))


def test_the_target_is_named_too(unchecked):
    refuses("target is None", meshot.chamfer, cube(), None)


@pytest.mark.parametrize("n", [7, np.int64(7), np.uint8(7)])
@pytest.mark.parametrize("d", [1, 2, 3, 6])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_number_of_directions_means_even_ones_of_seed_zero(n, d, dtype):
    source, target = (problems.cloud(seed, 8, d, dtype=dtype) for seed in (0, 1))
    lines = quasi_directions(7, d, 0, dtype)
    assert torch.equal(meshot.slice_costs(source, target, n), meshot.slice_costs(source, target, lines))
    assert float(meshot.sliced_wasserstein(source, target, n)) == float(
        meshot.sliced_wasserstein(source, target, lines)
    )
    sets = torch.stack([quasi_directions(7, d, seed, dtype) for seed in (0, 1)])
    windows = source.points[:2], 3.0
    assert float(meshot.windowed_sliced_wasserstein(source, target, *windows, n)) == float(
        meshot.windowed_sliced_wasserstein(source, target, *windows, sets)
    )


@pytest.mark.parametrize(
    ("directions", "words"),
    [(0, "directions is 0"), (True, "directions is True"), (np.int64(-3), "integer >= 1"), (None, "directions cannot"),
     (7.0, r"directions has shape \(\)"), ("ten", "directions cannot"), (LINES[:, :2], r"\(n, 3\) is needed"),
     (2 * LINES, "unit rows are needed")],
)  # fmt: skip
def test_other_directions_are_refused(unchecked, directions, words):
    source, target = problems.cloud(0, 8, 3), problems.cloud(1, 8, 3)
    for loss in (meshot.sliced_wasserstein, meshot.slice_costs):
        refuses(words, loss, source, target, directions)
    refuses("directions", meshot.windowed_sliced_wasserstein, source, target, CENTRES, 1.0, directions)
