"""A standstill: nothing moves where faces would cross, everything else moves as before."""

import pytest
import torch

from meshot.flow.fields import GridVelocity, grid_around
from meshot.flow.integration import integrate
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.editing import with_edges_split
from meshot.mesh.geometry import mesh_edges
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot_book import flows as damping
from meshot_book.flows import damped, without_crossings


def uniform(interpolation: str = "cubic") -> GridVelocity:
    """Everything goes 1 mm along x in unit time; two levels and two pieces of time."""
    field = GridVelocity(
        torch.full((3,), -20.0).double(), torch.full((3,), 20.0).double(), (4.0, 2.0), 2, interpolation
    )
    with torch.no_grad():
        field.levels[0][..., 0] = 0.75
        field.levels[1][..., 0] = 0.25
    return field


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_still_near_places_and_as_before_away_from_them(interpolation):
    field, place = uniform(interpolation), torch.tensor([[3.0, -1.0, 2.0]]).double()
    calm = damped(field, place, 8.0)
    generator = torch.Generator().manual_seed(0)
    points = 40 * torch.rand(4000, 3, generator=generator, dtype=torch.float64) - 20
    points[:100] = place + points[:100] / 40  # at most .9 mm away
    away = (points - place).norm(dim=1)
    reach = 2 * 3**0.5 * 2  # half of the 4 × 4 × 4 nodes around a point, at 2 mm
    for time in (0.1, 0.9):
        before, after = (f(torch.tensor(time), points).detach() for f in (field, calm))
        torch.testing.assert_close(before, torch.eye(3)[0].double().expand(4000, 3))
        assert float(after[away < 8.0 - reach].abs().max()) == 0
        torch.testing.assert_close(after[away > 16.0 + reach], before[away > 16.0 + reach])
        assert float(after[:, 0].min()) >= 0
        assert float(after[:, 0].max()) <= 1 + 1e-12
    # A ramp of 8 mm: an eighth per mm along the ray, and little more for what the grid adds.
    assert 0.05 < float(calm.lipschitz_bound().detach()) < 0.3
    assert field.levels[0].tolist()[0][0][0][0][0] == 0.75


def plates() -> Mesh:
    """Two parallel plates, 2 mm apart, each of 512 triangles 1 mm long."""
    square = Mesh(
        torch.tensor([[-8.0, -8, 0], [8, -8, 0], [8, 8, 0], [-8, 8, 0]]).double(), torch.tensor([[0, 1, 2], [0, 2, 3]])
    )
    for _ in range(4):
        square = with_edges_split(square, mesh_edges(square))
    up = torch.tensor([0.0, 0.0, 2.0]).double()
    n = len(square.vertices)
    return Mesh(torch.cat([square.vertices, square.vertices + up]), torch.cat([square.faces, square.faces + n]))


def crossing_field(mesh: Mesh) -> GridVelocity:
    """Noise of a length that the triangles cannot follow."""
    field = grid_around(mesh.vertices, margin=4.3, spacings=(1.0,), n_pieces=1)  # no node at a vertex
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        field.levels[0].normal_(0, 0.3, generator=generator)
        middle = field.levels[0].shape[1] // 2
        field.levels[0][:, middle - 2 : middle + 2, middle - 2 : middle + 2] *= 15
    return field


def test_crossings_go_and_the_rest_still_moves():
    mesh = plates()
    field = crossing_field(mesh)
    before = mesh.with_vertices(integrate(field, mesh.vertices, 4).detach())
    assert len(self_intersecting_faces(mesh)) == 0
    assert len(self_intersecting_faces(before)) > 10
    calm = without_crossings(field, mesh, 4, radius=1.5)
    after = mesh.with_vertices(integrate(calm, mesh.vertices, 4).detach())
    assert len(self_intersecting_faces(after)) == 0
    same = (after.vertices - before.vertices).norm(dim=1) < 1e-9
    assert float(same.double().mean()) > 0.3
    moved = (after.vertices - mesh.vertices).norm(dim=1)
    assert float((moved > 0.01).double().mean()) > 0.5


def test_a_field_without_fault_is_returned_as_it_is():
    field = uniform()
    assert without_crossings(field, icosphere(2, 5.0), 4) is field


def test_the_radius_grows_after_every_third_round(monkeypatch):
    radii = []
    monkeypatch.setattr(damping, "damped", lambda field, places, radius: radii.append(radius) or field)
    mesh = plates()
    with pytest.raises(ValueError, match="still cross after 7 rounds"):
        without_crossings(crossing_field(mesh), mesh, 4, radius=1.5, max_rounds=7)
    assert radii == [1.5, 1.5, 1.5, 3.0, 3.0, 3.0, 4.5]


def test_doors(unchecked):
    field, mesh = uniform(), plates()
    with pytest.raises(ValueError, match="radius"):
        damped(field, mesh.vertices, 0.0)
    with pytest.raises(ValueError, match="places"):
        damped(field, mesh.vertices[:, :2], 1.0)
    with pytest.raises(ValueError, match="max_rounds"):
        without_crossings(field, mesh, max_rounds=0)
    leaning = mesh.vertices.clone()
    n_lower = len(leaning) // 2
    leaning[:n_lower, 2] += 0.93 * leaning[:n_lower, 0]  # the lower plate, tilted through the upper
    crossed = mesh.with_vertices(leaning)
    with pytest.raises(ValueError, match="before the flow"):
        without_crossings(field, crossed)
    with pytest.raises(ValueError, match="still cross after 1 rounds"):
        without_crossings(crossing_field(mesh), mesh, 4, radius=0.01, max_rounds=1)
