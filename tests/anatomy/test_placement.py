"""Placement by white matter: the map between normal distributions, the grid, and heads with and without a skull."""

import numpy as np
import pytest
import torch
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation

from meshot.anatomy.templates import (
    ENLARGEMENT,
    HEMISPHERES,
    Moments,
    from_mni152,
    fsaverage5_surface,
    gaussian_transport,
    in_mni152,
    moments_of,
    placed_by_white_matter,
)
from meshot.volume.registration import EXTENT_MM, SHAPE, place_on_grid
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume, transform_points


def some_moments(seed):
    draw = np.random.default_rng(seed)
    factor = draw.normal(size=(3, 3)) + 3 * np.eye(3)
    return Moments(draw.normal(size=3), factor @ factor.T)


def test_the_map_takes_one_normal_distribution_to_the_other_and_is_a_gradient():
    source, target = some_moments(0), some_moments(1)
    moved = gaussian_transport(source, target)
    linear = moved[:3, :3]
    np.testing.assert_allclose(linear @ source.covariance @ linear.T, target.covariance, rtol=1e-12)
    np.testing.assert_allclose(linear @ source.mean + moved[:3, 3], target.mean, rtol=1e-12)
    np.testing.assert_allclose(linear, linear.T, atol=1e-12)  # the gradient of a convex function: Brenier
    assert np.linalg.eigvalsh(linear).min() > 0
    root = sqrtm(source.covariance)
    twin = np.linalg.inv(root) @ sqrtm(root @ target.covariance @ root) @ np.linalg.inv(root)
    np.testing.assert_allclose(linear, twin, rtol=1e-9)


def test_its_cost_is_that_of_bures():
    source, target = some_moments(2), some_moments(3)
    linear = gaussian_transport(source, target)[:3, :3]
    cost = np.trace((linear - np.eye(3)) @ source.covariance @ (linear - np.eye(3)).T)
    root = sqrtm(source.covariance)
    bures = np.trace(source.covariance + target.covariance - 2 * sqrtm(root @ target.covariance @ root))
    assert cost == pytest.approx(float(np.real(bures)), rel=1e-9)


def test_a_flat_mass_is_refused():
    with pytest.raises(ValueError, match="flat"):
        gaussian_transport(Moments(np.zeros(3), np.diag([1.0, 1.0, 0.0])), some_moments(0))


def head(to_scanner):
    """White matter of fsaverage5 in a scanner, as a mask of a grid, and its surfaces there."""
    surfaces = [fsaverage5_surface("white", side, "MNI152") for side in HEMISPHERES]
    moved = [mesh.with_vertices(transform_points(to_scanner, mesh.vertices)) for mesh in surfaces]
    corners = torch.cat([mesh.vertices for mesh in moved])
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = corners.min(dim=0).values.numpy() - 5
    shape = tuple(((corners.max(dim=0).values - corners.min(dim=0).values).numpy() / 2 + 6).astype(int))
    grid = Volume(np.zeros(shape), affine)
    return grid.with_data(sum(enclosed_fractions(mesh, grid) for mesh in moved).astype(np.float32)), moved


def known_place(scale):
    """A head that is stretched by a symmetric matrix, and the grey values' placement that knows nothing of it."""
    turn = Rotation.from_euler("xyz", [20, -10, 30], degrees=True).as_matrix()
    to_scanner = np.eye(4)
    to_scanner[:3, :3] = turn @ np.diag(scale) @ turn.T
    to_scanner[:3, 3] = [4.0, -7.0, 11.0]
    scan, surfaces = head(to_scanner)
    first = place_on_grid(scan, np.eye(4), np.zeros(3))
    return scan, surfaces, first, first.volume.with_data(first.volume.data > 0.5), to_scanner


def test_a_stretched_head_comes_back_to_its_place():
    scan, surfaces, first, mask, to_scanner = known_place([0.8, 0.9, 0.85])
    placed = placed_by_white_matter(scan, first, mask)
    for mesh, side in zip(surfaces, HEMISPHERES):
        there = in_mni152(mesh.with_vertices(placed.from_scanner(mesh.vertices)))
        gaps = (there.vertices - fsaverage5_surface("white", side, "MNI152").vertices).norm(dim=1)
        assert float(gaps.max()) < 0.8  # mm; voxels of 2 mm are seen on a grid of 1.5 mm
    assert placed.volume.data.shape == SHAPE
    scales = np.linalg.svd(placed.to_standard[:3, :3] @ to_scanner[:3, :3], compute_uv=False)
    np.testing.assert_allclose(scales, ENLARGEMENT, rtol=0.01)


def test_the_enlarged_cerebrum_fits_the_grid():
    corners = torch.cat([from_mni152(fsaverage5_surface("pial", side, "MNI152")).vertices for side in HEMISPHERES])
    lengths = (corners.max(dim=0).values - corners.min(dim=0).values).numpy()
    voxels = lengths / (np.array(EXTENT_MM) / np.array(SHAPE))
    assert (voxels < np.array(SHAPE) - 10).all()
    assert round(float(voxels.max())) == 130  # as the comment at ENLARGEMENT says


def test_to_mni152_and_back():
    mesh = fsaverage5_surface("white", "left", "MNI152")
    assert torch.allclose(in_mni152(from_mni152(mesh)).vertices, mesh.vertices)


def test_too_little_or_misplaced_white_matter_is_refused():
    scan, _, first, mask, _ = known_place([1.0, 1.0, 1.0])
    few = np.zeros_like(mask.data)
    few[60:69, 60:69, 60:69] = True
    with pytest.raises(ValueError, match="729 voxels; 1000 or more"):
        placed_by_white_matter(scan, first, mask.with_data(few))
    few[50:70, 50:70, 50:70] = True
    with pytest.raises(ValueError, match="are plausible: was white matter of both sides found"):
        placed_by_white_matter(scan, first, mask.with_data(few))


def test_moments_of_a_box():
    data = np.zeros((40, 40, 40), dtype=bool)
    data[5:25, 10:20, 10:30] = True
    affine = np.diag([2.0, 1.0, 1.0, 1.0])
    found = moments_of(Volume(data, affine))
    np.testing.assert_allclose(found.mean, [2 * 14.5, 14.5, 19.5])
    expected = [4 * (20**2 - 1) / 12, (10**2 - 1) / 12, (20**2 - 1) / 12]
    np.testing.assert_allclose(np.diag(found.covariance), expected, rtol=1e-3)
