"""Known motions are found again; what differs beyond a motion stays as the residue."""

import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.shapes import ellipsoid, folded_sphere
from meshot.metrics.distances import rigidly_aligned

TURN = Rotation.from_rotvec(np.radians([4.0, -6.0, 8.0]))
SHIFT = np.array([3.0, -2.0, 4.0])


def moved(mesh, rotation=TURN, shift=SHIFT):
    return mesh.with_vertices(torch.from_numpy(rotation.apply(mesh.vertices.numpy()) + shift))


def worst(one, other):
    return float((one.vertices - other.vertices).norm(dim=1).max())


@pytest.mark.parametrize("make", [lambda: folded_sphere(4), lambda: ellipsoid(4, (40.0, 30.0, 50.0))])
def test_a_known_motion_is_undone(make):
    target = make()
    found = rigidly_aligned(moved(target), target, n_points=4000)
    assert worst(found.mesh, target) < 1e-4
    assert found.residue < 1e-5 < found.residues[0]
    np.testing.assert_allclose(found.rotation @ TURN.as_matrix(), np.eye(3), atol=1e-6)
    np.testing.assert_allclose(found.rotation @ SHIFT + found.translation, 0, atol=1e-4)
    assert found.turn_degrees == pytest.approx(math.sqrt(4**2 + 6**2 + 8**2), abs=1e-4)


def test_a_cortical_surface_comes_back():
    target = fsaverage5_surface("white", "left")
    found = rigidly_aligned(moved(target), target, n_points=3000)
    assert worst(found.mesh, target) < 1e-3
    assert (np.diff(found.residues) <= 1e-9).all()


def test_noise_stays_as_the_residue_and_hardly_turns():
    target = folded_sphere(4)
    noise = torch.from_numpy(np.random.default_rng(0).normal(scale=0.3, size=target.vertices.shape))
    source = moved(target.with_vertices(target.vertices + noise))
    found = rigidly_aligned(source, target, n_points=4000)
    exact = moved(source, TURN.inv(), TURN.inv().apply(-SHIFT))
    assert worst(found.mesh, exact) < 0.15  # of points as far as 46 mm from the centre
    # The nearest point of the faces is nearer than where the vertex came from; a face averages three of them.
    assert 0.1 < found.residue < 0.3


def test_nothing_to_do_is_done_at_once():
    target = folded_sphere(3)
    found = rigidly_aligned(target, target, n_points=500)
    assert len(found.residues) <= 3
    assert found.turn_degrees < 1e-5
    assert worst(found.mesh, target) < 1e-6


def test_it_takes_single_precision_and_repeats():
    target = folded_sphere(3)
    source = moved(target).to(torch.float32)
    one, again = (rigidly_aligned(source, target, n_points=800, generator=3) for _ in range(2))
    assert one.mesh.vertices.dtype == torch.float32
    assert torch.equal(one.mesh.vertices, again.mesh.vertices)
    assert one.mesh.faces is source.faces


def test_too_few_steps_are_said():
    target = folded_sphere(3)
    with pytest.warns(UserWarning, match="still move"):
        rigidly_aligned(moved(target), target, n_points=500, max_steps=1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"max_steps": 0}, "max_steps is 0"),
        ({"tolerance": 0.0}, "tolerance is 0.0"),
        ({"n_points": 0}, "n_points is 0"),
    ],
)
def test_doors(arguments, words):
    with pytest.raises(ValueError, match=words):
        rigidly_aligned(folded_sphere(1), folded_sphere(1), **arguments)
