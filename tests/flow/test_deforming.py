"""A fit in one call: it reaches the target, at any size and in any place, and refuses what it cannot do."""

import numpy as np
import pytest
import torch
import trimesh

import meshot
from meshot import Mesh, deform, integrate
from meshot.flow.fields import grid_around
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.shapes import cube, folded_sphere, icosphere
from meshot.metrics.distances import Surface, average_surface_distance, offsets_between

QUICK = {"n_iterations": 60, "detail": 0.15, "progress": False}


def pair(scale: float, dtype: torch.dtype = torch.float64) -> tuple[Mesh, Mesh]:
    source, target = icosphere(2, 1.0), folded_sphere(2, 1.0, 0.25, 4)
    return tuple(mesh.with_vertices(scale * mesh.vertices).to(dtype) for mesh in (source, target))


def distance(one: Mesh, other: Mesh) -> float:
    return average_surface_distance(*offsets_between(Surface(one), Surface(other), 5000))


@pytest.fixture(scope="module")
def at_one():
    return deform(*pair(1.0), **QUICK)


def test_the_flow_carries_the_sphere_to_the_folds(at_one):
    source, target = pair(1.0)
    assert distance(at_one.mesh, target) < 0.35 * distance(source, target)
    assert at_one.losses[-1] < 0.1
    assert torch.equal(at_one.mesh.faces, source.faces)
    assert len(self_intersecting_faces(at_one.mesh)) == 0


def test_the_detail_is_a_share_of_half_the_longest_side(at_one):
    everything = torch.cat([mesh.vertices for mesh in pair(1.0)])
    longest = float((everything.amax(dim=0) - everything.amin(dim=0)).max())
    assert at_one.flow.spacings[-1] == pytest.approx(QUICK["detail"] * longest / 2, rel=1e-12)


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


@pytest.mark.parametrize("scale", [100.0, 1e-3])
def test_the_same_settings_do_at_every_size(at_one, scale):
    """Vertices are rounded differently at every size, and sixty steps of Adam enlarge that: the first steps agree."""
    few = QUICK | {"n_iterations": 5}
    one, found = deform(*pair(1.0), **few), deform(*pair(scale), **few)
    torch.testing.assert_close(found.mesh.vertices / scale, one.mesh.vertices, rtol=0, atol=1e-6)
    whole = deform(*pair(scale), **QUICK)
    assert whole.losses[-1] == pytest.approx(at_one.losses[-1], rel=0.1)
    assert whole.n_steps == at_one.n_steps


def test_a_place_far_from_the_origin_is_as_good(at_one):
    shift = torch.tensor([50.0, -20.0, 8.0], dtype=torch.float64)
    found = deform(*(mesh.with_vertices(mesh.vertices + shift) for mesh in pair(1.0)), **QUICK)
    # Coordinates near 50 are rounded 50 times more coarsely, and Adam's path is chaotic: where it ends is alike.
    goal = pair(1.0)[1]
    near = [distance(mesh, goal) for mesh in (at_one.mesh, found.mesh.with_vertices(found.mesh.vertices - shift))]
    assert near[1] == pytest.approx(near[0], rel=0.1)


def test_any_loss_between_meshes_will_do():
    source, target = pair(10.0)
    found = deform(source, target, meshot.chamfer, **QUICK)
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
    found = deform(source, source, loss, **QUICK | {"n_iterations": 3})
    assert torch.equal(found.mesh.vertices, source.vertices)
    assert torch.equal(found.carry(source.vertices), source.vertices)


def test_a_mesh_does_not_go_away_from_its_target():
    """A loss that rises with every motion, and whose gradient at the start is not zero, leaves the source in place."""
    source, target = pair(1.0)

    def kinked(mesh, target):
        way = (mesh.vertices - source.vertices)[:, 0].sum()
        return 1 + torch.where(way > 0, way, -3 * way)

    found = deform(source, target, kinked, **QUICK | {"n_iterations": 1})
    assert torch.equal(found.mesh.vertices, source.vertices)


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
    one = cube()
    return Mesh(torch.cat([one.vertices, one.vertices + 0.5]), torch.cat([one.faces, one.faces + 8]))


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
    with pytest.raises(ValueError, match=words):
        deform(**({"source": cube(), "target": cube(2.0), **QUICK} | change))


def test_crossings_may_be_allowed():
    assert deform(crossing(), cube(2.0), allow_crossings=True, **QUICK | {"n_iterations": 2}).n_steps > 0
