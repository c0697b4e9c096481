"""The miniature subjects have the features that they claim, on both sides, and a bridge only in the image."""

import numpy as np
import pytest
import torch

from meshot.mesh.connectivity import SPHERE, self_intersecting_faces, topology
from meshot.mesh.geometry import signed_volume
from meshot.metrics.distances import vertex_distances
from meshot.volume.surfaces import enclosed_fractions, filled_cavities, isosurface, largest_component
from meshot_book.examples.miniatures import FEATURES, Folds, folded_ball, miniature

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def subject():
    return miniature(6)


@pytest.mark.parametrize("side", SIDES)
def test_true_and_initial_surfaces_are_spheres_that_do_not_cross(subject, side):
    for mesh in (subject.example.targets[side, "white"], subject.example.scan.initial[side, "white"]):
        assert topology(mesh) == SPHERE
        assert len(self_intersecting_faces(mesh)) == 0
        assert float(signed_volume(mesh)) > 0


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("feature", FEATURES)
def test_every_feature_is_missed_by_the_initial_surface_and_by_no_true_one(subject, side, feature):
    start, target = subject.example.scan.initial[side, "white"], subject.example.targets[side, "white"]
    assert subject.distance_at(feature, side, target) < 1e-4
    everywhere = vertex_distances(target, start).mean()
    assert subject.distance_at(feature, side, start) > 1.3 * everywhere


def test_a_distance_is_that_of_the_vertices_of_the_feature(subject):
    target = subject.example.targets["left", "white"]
    lifted = target.with_vertices(target.vertices + torch.tensor([0.0, 0.0, 100.0]))
    from_top, from_bottom = (subject.distance_at(name, "left", lifted) for name in ("thin gyrus", "bridged sulcus"))
    assert 75 < from_top < from_bottom - 12


def test_the_gyrus_and_the_buried_sulcus_are_narrower_than_a_voxel():
    mesh, folds = folded_ball(Folds()), Folds()
    gyrus = mesh.vertices[folds.near("thin gyrus", mesh.vertices)]
    on_sides = gyrus[(gyrus[:, 1].abs() < 3) & (gyrus[:, 2] > 10) & (gyrus[:, 2] < 11)]
    assert float(on_sides[:, 0].max() - on_sides[:, 0].min()) == pytest.approx(1.2, abs=0.2)
    buried = mesh.vertices[folds.near("buried sulcus", mesh.vertices)]
    banks = buried[buried[:, 1].abs() < 3]
    assert float(banks[:, 2].max() - banks[:, 2].min()) == pytest.approx(0.7, abs=0.2)


def test_the_bridge_is_a_handle_of_the_image_and_not_of_the_surface(subject):
    image = subject.example.scan.image
    inside = sum(enclosed_fractions(subject.example.targets[side, "white"], image) for side in SIDES)
    added = image.data - 0.4 - 0.4 * inside
    assert np.abs(added).max() > 0.2
    assert np.quantile(np.abs(added), 0.95) < 0.08
    for side, kept in zip(SIDES, (np.arange(40) < 20, np.arange(40) >= 20)):
        mask = filled_cavities(largest_component((image.data > 0.6) & kept[:, None, None]))
        assert topology(isosurface(image.with_data(mask.astype(float)))).euler_number < 2, side


def test_a_seed_repeats_and_others_differ(subject):
    again, other = miniature(6), miniature(9)
    np.testing.assert_array_equal(again.example.scan.image.data, subject.example.scan.image.data)
    assert again.folds == subject.folds != other.folds
    assert again.without_initial.scan.initial == {}


def test_an_unknown_feature_is_refused(subject):
    with pytest.raises(ValueError, match="there is no feature 'tumour'; name one of thin gyrus"):
        Folds().near("tumour", torch.zeros(1, 3))
