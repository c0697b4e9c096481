"""Where planes cut surfaces: circles, squares, closed lines."""

import math

import pytest
import torch
from hypothesis import given, settings, strategies as st

from meshot.mesh.geometry import plane_section
from meshot.mesh.shapes import cube, icosphere

DOUBLE = torch.float64


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_sphere_is_cut_in_a_circle_of_the_right_radius_and_length(axis):
    centre = torch.tensor([3.0, -2.0, 5.0], dtype=DOUBLE)
    height = 0.6
    segments = plane_section(icosphere(5, 10.0, tuple(centre.tolist())), axis, float(centre[axis]) + 10 * height)
    away = segments - centre
    assert torch.allclose(away[..., axis], torch.full_like(away[..., axis], 10 * height), atol=1e-12)
    radius = math.sqrt(10**2 - 6**2)
    distances = away[..., [i for i in range(3) if i != axis]].norm(dim=-1)
    # Chords lie inside the sphere: the sagitta of the longest edge (.38) is .0018, doubled by the oblique cut.
    assert float(distances.max()) <= radius + 1e-9
    assert float(distances.min()) > radius - 0.005
    length = (segments[:, 1] - segments[:, 0]).norm(dim=-1).sum()
    assert float(length) == pytest.approx(2 * math.pi * radius, rel=1e-3)


def test_a_cube_is_cut_in_a_square():
    segments = plane_section(cube(2.0, DOUBLE), 2, 0.25)
    assert float((segments[:, 1] - segments[:, 0]).norm(dim=-1).sum()) == pytest.approx(8.0)
    assert segments[..., 2].unique().tolist() == [0.25]


def test_a_plane_beside_the_surface_cuts_nothing():
    assert plane_section(icosphere(1), 0, 1.5).shape == (0, 2, 3)


@settings(max_examples=30)
@given(position=st.one_of(st.floats(-0.99, 0.99), st.sampled_from([0.0, 1 / math.sqrt(1.25 + math.sqrt(1.25))])))
def test_a_closed_surface_gives_closed_lines_even_through_its_vertices(position):
    """Every end of a segment is met by another end."""
    ends = plane_section(icosphere(2), 2, position).reshape(-1, 3)
    gaps = torch.cdist(ends, ends, compute_mode="donot_use_mm_for_euclid_dist") + 9 * torch.eye(len(ends), dtype=DOUBLE)
    assert float(gaps.min(dim=1).values.max()) < 1e-12


def test_the_gradient_reaches_the_vertices():
    mesh = icosphere(1)
    moving = mesh.with_vertices(mesh.vertices.clone().requires_grad_())
    plane_section(moving, 1, 0.1).sum().backward()
    assert bool((moving.vertices.grad != 0).any())


def test_an_axis_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="axis is 3"):
        plane_section(icosphere(0), 3, 0.0)
