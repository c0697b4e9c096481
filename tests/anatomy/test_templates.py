"""Templates, the placement of scans by their white matter, and their contrast."""

import socket

import numpy as np
import pytest
import torch
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation

from meshot.anatomy.templates import (
    ENLARGEMENT,
    GREY,
    HEMISPHERES,
    WHITE,
    Moments,
    contrast_by_white_matter,
    enlarged,
    from_mni152,
    fsaverage5_surface,
    gaussian_transport,
    in_mni152,
    mni152_brain_mask,
    mni152_grey_matter,
    mni152_t1,
    mni152_white_matter,
    moments_of,
    placed_by_white_matter,
)
from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import signed_volume
from meshot.volume.registration import EXTENT_MM, SHAPE, place_on_grid
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume, transform_points, voxel_sizes
from refusals import refuses


@pytest.fixture(autouse=True)
def no_network(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("something touched the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    with pytest.raises(AssertionError, match="network"):
        socket.create_connection(("example.org", 80))


def test_the_average_at_one_millimetre():
    t1, white, grey, brain = mni152_t1(), mni152_white_matter(), mni152_grey_matter(), mni152_brain_mask()
    for volume in (t1, white, grey, brain):
        assert volume.data.shape == (197, 233, 189)
        assert np.array_equal(volume.affine, t1.affine)
    assert voxel_sizes(t1).tolist() == [1, 1, 1]
    assert (t1.data.min(), t1.data.max()) == (0, 1)
    assert brain.data.dtype == bool
    # 1.9 litres of brain, a third of it white: an average of many heads in MNI space is large.
    assert brain.data.sum() == pytest.approx(1.88e6, rel=0.02)
    assert 0.4e6 < (white.data > 0.5).sum() < 0.8e6
    assert t1.data[white.data > 0.9].mean() > t1.data[grey.data > 0.9].mean()


@pytest.mark.parametrize("hemisphere", ["left", "right"])
def test_the_surfaces_are_spheres_of_the_right_side(hemisphere):
    white, pial = (fsaverage5_surface(kind, hemisphere) for kind in ("white", "pial"))
    assert topology(white) == topology(pial) == SPHERE
    assert len(white.vertices) == 10_242
    assert 0 < float(signed_volume(white)) < float(signed_volume(pial))
    assert (float(white.vertices[:, 0].mean()) < 0) == (hemisphere == "left")


@pytest.mark.parametrize(("kind", "side"), [("inner", "left"), ("white", "both")])
def test_other_surfaces_do_not_exist(unchecked, kind, side):
    refuses("no surface", fsaverage5_surface, kind, side)


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


def test_a_flat_mass_is_refused():
    refuses("flat", gaussian_transport, Moments(np.zeros(3), np.diag([1.0, 1.0, 0.0])), some_moments(0))


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


def test_a_volume_is_enlarged_as_a_mesh_is():
    """A surface encloses the same voxels of a volume before and after both were enlarged."""
    mesh = fsaverage5_surface("white", "left", "MNI152")
    assert torch.allclose(in_mni152(from_mni152(mesh)).vertices, mesh.vertices)
    affine = np.diag([8.0, 8.0, 8.0, 1.0])
    affine[:3, 3] = [-88, -120, -80]
    volume = Volume(np.zeros((22, 28, 22)), affine)
    moved = enlarged(volume)
    assert not np.allclose(moved.affine, affine)
    np.testing.assert_allclose(
        enclosed_fractions(from_mni152(mesh), moved), enclosed_fractions(mesh, volume), atol=1e-5
    )


def test_too_little_or_misplaced_white_matter_is_refused():
    scan, _, first, mask, _ = known_place([1.0, 1.0, 1.0])
    few = np.zeros_like(mask.data)
    few[60:69, 60:69, 60:69] = True
    refuses("729 voxels; 1000 or more", placed_by_white_matter, scan, first, mask.with_data(few))
    few[50:70, 50:70, 50:70] = True
    words = "are plausible: was white matter of both sides found"
    refuses(words, placed_by_white_matter, scan, first, mask.with_data(few))


def test_moments_of_a_box():
    data = np.zeros((40, 40, 40), dtype=bool)
    data[5:25, 10:20, 10:30] = True
    affine = np.diag([2.0, 1.0, 1.0, 1.0])
    found = moments_of(Volume(data, affine))
    np.testing.assert_allclose(found.mean, [2 * 14.5, 14.5, 19.5])
    expected = [4 * (20**2 - 1) / 12, (10**2 - 1) / 12, (20**2 - 1) / 12]
    np.testing.assert_allclose(np.diag(found.covariance), expected, rtol=1e-3)


CONTRAST_SHAPE = (64, 60, 62)
PLACES = np.indices(CONTRAST_SHAPE).transpose(1, 2, 3, 0) - np.array(CONTRAST_SHAPE) / 2
RADIUS = np.linalg.norm(PLACES, axis=-1)
INSIDE_WHITE, INSIDE_GREY = RADIUS < 18, RADIUS < 23


def ball(white: float, grey: float, air: float = 0.0) -> Volume:
    """White matter in grey matter in air, with voxels of 1.5 mm."""
    data = np.select([INSIDE_WHITE, INSIDE_GREY], [white, grey], air)
    return Volume(data.astype(np.float32), np.diag([1.5, 1.5, 1.5, 1.0]))


@pytest.mark.parametrize(("white", "grey"), [(0.9, 0.5), (0.4, 0.3), (0.6, 0.2)])
def test_both_tissues_get_their_levels(white, grey):
    found = contrast_by_white_matter(ball(white, grey), INSIDE_WHITE).data
    assert found.dtype == np.float32
    np.testing.assert_allclose(found[INSIDE_WHITE], WHITE, atol=0.005)
    np.testing.assert_allclose(found[INSIDE_GREY & ~INSIDE_WHITE], GREY, atol=0.01)
    assert np.abs(found[~INSIDE_GREY]).max() == 0


def test_the_order_of_values_is_kept_and_the_range():
    volume = ball(0.5, 0.3)
    volume.data[30, 30, 2:12] = np.linspace(0, 1, 10)  # a bright vessel in the air
    found = contrast_by_white_matter(volume, INSIDE_WHITE).data
    vessel = found[30, 30, 2:12]
    assert (np.diff(vessel) >= 0).all()
    assert (found.min(), found.max()) == (0, 1)


def test_a_bias_field_goes_away():
    smooth = np.exp(0.3 * np.sin(PLACES[..., 0] / 20 + 0.3) + 0.15 * PLACES[..., 2] / 20)
    affine = np.diag([4.0, 4.0, 4.0, 1.0])  # a ball of the size of a brain
    biased = Volume((ball(0.5, 0.3).data * smooth).astype(np.float32), affine)
    before = biased.data[INSIDE_WHITE].std() / biased.data[INSIDE_WHITE].mean()
    found = contrast_by_white_matter(biased, INSIDE_WHITE).data
    after = found[INSIDE_WHITE].std() / found[INSIDE_WHITE].mean()
    assert before > 0.1
    assert after < before / 2
    shell = INSIDE_GREY & ~INSIDE_WHITE
    assert found[shell].std() < biased.data[shell].std()
    assert np.median(found[shell]) == pytest.approx(GREY, abs=0.02)


def test_small_errors_of_the_mask_do_not_matter():
    noisy = ball(0.5, 0.3)
    noisy = noisy.with_data(noisy.data + np.random.default_rng(0).normal(0, 0.02, CONTRAST_SHAPE).astype(np.float32))
    exact = contrast_by_white_matter(noisy, INSIDE_WHITE).data
    for radius in (17, 19):
        other = contrast_by_white_matter(noisy, radius > RADIUS).data
        assert np.abs(other - exact)[INSIDE_GREY].max() < 0.03


def test_levels_in_another_order_are_left():
    volume = ball(0.4, 0.8)  # as in a T2
    found = contrast_by_white_matter(volume, INSIDE_WHITE).data
    np.testing.assert_allclose(found[INSIDE_WHITE], WHITE, atol=0.005)
    assert (found[INSIDE_GREY & ~INSIDE_WHITE] > WHITE).all()


def test_white_matter_without_depth_or_light_is_refused():
    sheet, none = np.zeros((2, *CONTRAST_SHAPE), dtype=bool)
    sheet[30:33] = True
    words = "no voxel of the white matter lies 2 voxels inside"
    refuses(words, contrast_by_white_matter, ball(0.5, 0.3), sheet)
    refuses("was white matter found", contrast_by_white_matter, ball(0.5, 0.3), none)
    refuses("the median of the white matter is 0", contrast_by_white_matter, ball(0.0, 0.5), INSIDE_WHITE)
