"""The exact sliced loss where a face has no area, a law is no law, and coordinates are tiny or huge."""

import numpy as np
import pytest
import torch

import oracles_exact
from meshot import Mesh, random_directions, sliced_wasserstein, surface
from meshot.loss import _kernel_exact as _kernel_exact_law, _kernel_exact as _kernel_exact_walk
from meshot.loss.exact import exact_sliced_wasserstein
from meshot.measure.continuous import SurfaceMeasure
from meshot.mesh.shapes import cube, icosphere

both = pytest.mark.parametrize("p", [1, 2])
CORNERS = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]], dtype=torch.float64)
#: Two coincident corners, three corners on a line, three coincident corners.
COLLAPSED = {
    "two corners": CORNERS,
    "a line": torch.cat([CORNERS[:3], torch.tensor([[0.5, 0, 0]], dtype=torch.float64)]),
    "a point": torch.cat([CORNERS, CORNERS[:1]]),
}
FACES = {"two corners": [[0, 1, 2], [0, 3, 1]], "a line": [[0, 1, 2], [0, 3, 1]], "a point": [[0, 1, 2], [0, 3, 4]]}


def directions() -> torch.Tensor:
    """Random ones and the axes, to which edges of the triangle are perpendicular."""
    return torch.cat([random_directions(6, 3, 0), torch.eye(3, dtype=torch.float64)])


@both
@pytest.mark.parametrize("name", COLLAPSED)
def test_a_collapsed_face_weighs_nothing(name, p):
    """The value, and the gradient of the vertices that are not its own, are those without the face."""
    values, gradients = [], []
    target = surface(cube(1.3))
    for faces in (FACES[name], FACES[name][:1]):
        vertices = COLLAPSED[name].clone().requires_grad_()
        values.append(sliced_wasserstein(surface(Mesh(vertices, torch.tensor(faces))), target, directions(), p))
        values[-1].backward()
        gradients.append(vertices.grad[:3])
    twin = surface(Mesh(COLLAPSED[name], torch.tensor(FACES[name][:1])))
    expected = oracles_exact.sliced_cost(twin, target, directions(), p)
    assert float(values[0].detach()) == pytest.approx(expected, rel=1e-12, abs=0)
    # Both sum the same few numbers; a face without mass adds breakpoints, at which cells are cut.
    torch.testing.assert_close(gradients[0], gradients[1], rtol=1e-9, atol=1e-12)


@both
def test_it_is_the_limit_of_faces_that_collapse(p):
    def value(gap: float) -> float:
        vertices = CORNERS + gap * torch.tensor([[0.0], [0], [0], [1]], dtype=torch.float64)
        return float(sliced_wasserstein(surface(Mesh(vertices, torch.tensor(FACES["two corners"]))), other, rows, p))

    other, rows = surface(icosphere(0)), directions()
    # The weight of the face, and with it the change of the cost, is at most proportional to the gap.
    assert [abs(value(gap) - value(0.0)) <= 10 * gap for gap in (1e-3, 1e-6, 1e-9)] == [True] * 3


def test_a_face_of_weight_zero_edge_on():
    """Perpendicular edges without a collapse: the weight is given, and the edge x = 0 has no extent along x."""
    measure = SurfaceMeasure(CORNERS[:3], torch.tensor([[0, 1, 2], [1, 2, 0]]), torch.tensor([1.0, 0]).double())
    alone = SurfaceMeasure(CORNERS[:3], torch.tensor([[0, 1, 2]]), torch.ones(1).double())
    assert float(exact_sliced_wasserstein(measure, alone, torch.eye(3).double())) == 0


@pytest.mark.parametrize("side", [0, 1])
def test_a_law_without_numbers_is_refused_and_not_walked_for_ever(side):
    law = (np.array([0.0, 1, 1]), np.array([1.0, 0, 0]), np.array([1.0, 0, np.inf]), np.zeros(3))
    broken = (law[0], law[1], np.array([np.nan, np.nan, np.inf]), law[3])
    pair = (broken, law) if side == 0 else (law, broken)
    with pytest.raises(ValueError, match="did not reach their ends"):
        _kernel_exact_walk.walk(2, *pair, (False, False), np.zeros((3, 3)), np.zeros((3, 3)))


@pytest.mark.parametrize("mass", [np.nan, np.inf, 0.0])
def test_masses_that_are_no_numbers_are_refused(mass):
    law = tuple(np.empty(5) for _ in range(4))
    with pytest.raises(ValueError, match="NaN, infinite or zero"):
        _kernel_exact_law.lay_points(np.array([0.0, 1]), np.array([0, 1]), np.array([mass, mass]), *law)


@both
@pytest.mark.parametrize("scale", [1e-150, 1e-120, 1e-12, 1e12, 1e90, 1e150])
def test_the_scale_does_not_matter(p, scale):
    """The coordinates are scaled by a power of two, so that only their own rounding under ``scale`` is left."""

    def measure(mesh: Mesh, factor: float) -> SurfaceMeasure:
        shares = surface(mesh).weights
        return SurfaceMeasure((mesh.vertices * factor).requires_grad_(), mesh.faces, shares)

    found = []
    for factor in (1.0, scale):
        pair = measure(icosphere(1), factor), measure(cube(1.3), factor)
        value = exact_sliced_wasserstein(*pair, random_directions(4, 3, 0), p)
        value.backward()
        found.append((float(value.detach()) / factor**p, pair[0].vertices.grad / factor ** (p - 1)))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-12)
    torch.testing.assert_close(found[1][1], found[0][1], rtol=1e-9, atol=1e-12)


def test_a_cost_beyond_float64_is_refused():
    vertices = torch.eye(3, dtype=torch.float64) * 1e160
    measure = SurfaceMeasure(vertices, torch.tensor([[0, 1, 2]]), torch.ones(1).double())
    with pytest.raises(ValueError, match="exceeds float64"):
        exact_sliced_wasserstein(measure, measure, torch.eye(3).double())
