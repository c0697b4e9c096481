"""The classical system: a gain field is removed, edges are found, and regions keep the sides apart."""

import numpy as np
import pytest
import scipy.ndimage
import torch

from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.systems import ExampleSets, Scan, get_system, read_settings
from meshot.systems.classical import (
    Atlas,
    SurfaceSettings,
    mean_fractions,
    misfit,
    moved_to_edges,
    thresholded_surface,
    whiteness,
)
from meshot.volume.surfaces import enclosed_fractions, winding_numbers
from meshot.volume.volume import Volume
from phantoms import AFFINE, SHAPE, phantom_subjects
from refusals import refuses

GRID = Volume(np.zeros(SHAPE), AFFINE)
BALL = icosphere(4, 8.0, (-10.0, 0.0, 0.0))


def test_a_smooth_gain_is_removed():
    inside = enclosed_fractions(BALL, GRID)
    gain = np.exp(np.linspace(-0.15, 0.15, SHAPE[1]))[None, :, None]
    scan = GRID.with_data((0.4 + 0.4 * inside) * gain)
    deep = inside > 0.99
    flat = whiteness(scan, deep, 6.0, 4)
    assert flat.data[deep].std() < 0.4 * (scan.data[deep] / np.median(scan.data[deep])).std()
    assert np.median(flat.data[deep]) == pytest.approx(1, abs=1e-6)
    torch.testing.assert_close(
        whiteness(scan.with_data(7 * scan.data), deep, 6.0, 4).data, flat.data, rtol=1e-9, atol=0
    )
    refuses("the median intensity in deep white matter is 0; a T1 on the standard grid", whiteness, GRID, deep, 6.0, 1)


def test_a_surface_moves_to_the_steepest_decrease():
    white = GRID.with_data(0.5 + 0.5 * enclosed_fractions(BALL, GRID))
    start = icosphere(4, 7.2, (-10.0, 0.0, 0.0))
    moved = moved_to_edges(start, white, 0.75, SurfaceSettings(rounds=20))
    assert vertex_distances(moved, BALL).mean() < 0.3 * vertex_distances(start, BALL).mean()


def test_the_outer_border_of_a_thin_cortex_is_not_taken_for_the_inner():
    cortex = icosphere(4, 9.0, (-10.0, 0.0, 0.0))
    white = GRID.with_data(0.7 * enclosed_fractions(cortex, GRID) + 0.3 * enclosed_fractions(BALL, GRID))
    start, moved = icosphere(4, 8.5, (-10.0, 0.0, 0.0)), {}
    for tolerance in (0.1, 100.0):
        found = moved_to_edges(start, white, 0.85, SurfaceSettings(rounds=20, tolerance=tolerance))
        moved[tolerance] = float(vertex_distances(found, BALL).mean())
    assert moved[0.1] < 0.3 < 0.5 < moved[100.0]  # the two borders are 1 mm apart


def test_among_equally_white_voxels_the_thin_bar_of_a_ring_is_cut():
    x, y, z = np.indices((48, 32, 16)) - np.array([24.0, 16.0, 8.0])[:, None, None, None]
    balls = (np.abs(x) - 14) ** 2 + y**2 + z**2 < 49
    thick, thin = ((np.abs(x) < 14) & ((y - place) ** 2 + z**2 < radius**2) for place, radius in ((-4, 3.5), (5, 1.5)))
    white = Volume((balls | thick | thin).astype(np.float64), np.eye(4))
    anywhere = np.ones(white.data.shape, dtype=bool)
    mesh = thresholded_surface(white, 0.5, anywhere, ~anywhere, "left white")
    inside = winding_numbers(mesh, white) > 0.5
    assert inside[scipy.ndimage.binary_erosion(balls | thick)].all()
    assert 0 < inside[thin & ~balls].mean() < 1


def test_the_sides_are_kept_apart_and_the_grid_is_required():
    (one,) = phantom_subjects(1, ())
    meshes = [one.targets[side, "white"] for side in ("left", "right")]
    atlas = Atlas(SHAPE, 2, mean_fractions([(meshes, one.scan.image)], 2))
    allowed = atlas.allowed(one.scan.image, 3.0)
    assert not (allowed[0] & allowed[1]).any()
    for mesh, region, deep in zip(meshes, allowed, atlas.deep(one.scan.image), strict=True):
        inside = enclosed_fractions(mesh, one.scan.image) > 0.5
        assert (inside & region).sum() > 0.99 * inside.sum()
        assert (deep & inside).sum() > 0.9 * deep.sum()
    with pytest.raises(ValueError, match=r"the scan has \(4, 4, 4\) voxels, those of the training \(32, 24, 24\)"):
        atlas.on_grid(Volume(np.zeros((4, 4, 4)), np.eye(4)))
    refuses("every axis must be a multiple of 5", Atlas, SHAPE, 5)
    nothing = np.zeros(SHAPE, dtype=bool)
    with pytest.raises(ValueError, match="no voxel is as bright as white matter for the surface left white"):
        thresholded_surface(GRID, 0.8, nothing, nothing, "left white")


def test_the_misfit_is_least_at_the_true_threshold_and_has_its_gradient():
    found = torch.linspace(0.4, 1.0, 61, dtype=torch.float64)
    truth = (found > 0.7).double()
    levels = torch.linspace(0.5, 0.9, 41, dtype=torch.float64)
    losses = torch.stack([misfit(found, truth, level) for level in levels])
    assert float(levels[losses.argmin()]) == pytest.approx(0.7, abs=0.011)
    assert torch.autograd.gradcheck(lambda x: misfit(found, truth, x), (levels[5].clone().requires_grad_(),))


def test_it_works_at_other_gains_and_says_what_is_wrong():
    torch.set_num_threads(1)
    kind = get_system("classical")
    sets = ExampleSets(phantom_subjects(2, ()), phantom_subjects(1, (), 50))
    system = kind.train(sets, read_settings(kind, "tiny"))
    item = sets.validation[0]
    image = item.scan.image
    found = [system.reconstruct(Scan(each)) for each in (image, image.with_data(0.5 * image.data))]
    for key, mesh in found[0].items():
        torch.testing.assert_close(found[1][key].vertices, mesh.vertices, atol=1e-3, rtol=0)
    refuses("the median intensity in deep white matter", system.reconstruct, Scan(image.with_data(0 * image.data)))
