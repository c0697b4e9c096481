"""From a probability to the initial surface: spheres, planted defects, a folded hemisphere, and back to the scanner."""

import numpy as np
import pytest
import torch

from affines import FLIPPED
from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.connectivity import SPHERE, self_intersecting_faces, topology
from meshot.mesh.geometry import signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.model.segmentation import SegmentationNetwork
from meshot.pipeline.initial_surface import segmented_surface
from meshot.pipeline.segmentation import in_scanner, initial_surfaces, segment
from meshot.volume.registration import EXTENT_MM, SHAPE, StandardScan
from meshot.volume.surfaces import enclosed_fractions, filled_cavities, isosurface, largest_component
from meshot.volume.volume import Volume
from phantoms import AFFINE, phantom_scan, phantom_surfaces
from refusals import refuses

CENTRE = (0.4, -0.7, 0.2)


def clean(mesh: Mesh) -> bool:
    return topology(mesh) == SPHERE and not len(self_intersecting_faces(mesh)) and float(signed_volume(mesh)) > 0


def ball(radius: float, affine: np.ndarray = AFFINE) -> Volume:
    grid = Volume(np.zeros((40, 40, 40)), affine)
    return grid.with_data(enclosed_fractions(icosphere(5, radius, CENTRE), grid, 9))


def test_a_sphere_is_found_to_a_tenth_of_a_millimetre():
    affine = np.diag([1.5, 208 / 144, 1.5, 1.0])
    affine[:3, 3] = -19.5 * np.diag(affine)[:3]
    surface = segmented_surface(ball(12.0, affine))
    radii = (surface.mesh.vertices - torch.tensor(CENTRE)).norm(dim=1)
    assert clean(surface.mesh)
    assert float((radii - 12).abs().mean()) < 0.05
    assert float((radii - 12).abs().max()) < 0.2
    inside = surface.distance.data < 0
    assert np.array_equal(inside, surface.mask.data)
    assert np.array_equal(surface.mask.data, surface.genus_zero_mask.data)


def with_defects() -> Volume:
    """A ball with a tunnel, a handle, a cavity and a loose piece."""
    affine = np.eye(4)
    affine[:3, 3] = -19.5
    field = ball(12.0, affine)
    data = field.data.copy()
    data[18:20, 18:20, :] *= 0.1
    data[8:32, 19:21, 36:38] = 0.9
    data[8:10, 19:21, 18:38] = 0.9
    data[30:32, 19:21, 18:38] = 0.9
    data[14:16, 24:26, 19:21] = 0.2
    data[0:3, 0:3, 0:3] = 1.0
    return field.with_data(data)


def euler_number(mask: np.ndarray) -> int:
    return topology(isosurface(Volume(mask.astype(float), np.eye(4)))).euler_number


def test_defects_are_mended():
    field = with_defects()
    surface = segmented_surface(field)
    before = filled_cavities(largest_component(field.data > 0.5))
    # A plug closes the tunnel. The handle stays, since the membrane in it would be large, and is cut.
    assert [euler_number(mask) for mask in (before, surface.mask.data, surface.genus_zero_mask.data)] == [-2, 0, 2]
    assert surface.mask.data.sum() - before.sum() == 4
    assert clean(surface.mesh)
    assert clean(surface.raw_mesh)
    assert (surface.genus_zero_mask.data <= surface.mask.data).all()
    n_lost = int(surface.mask.data.sum() - surface.genus_zero_mask.data.sum())
    assert 0 < n_lost < 0.05 * surface.mask.data.sum()


@pytest.fixture(scope="module")
def hemisphere():
    sizes = np.divide(EXTENT_MM, SHAPE)
    affine = np.diag([*sizes, 1.0])
    affine[:3, 3] = np.array([0, -17, 10]) - sizes * (np.array(SHAPE) - 1) / 2
    truth = fsaverage5_surface("white", "left")
    grid = Volume(np.zeros(SHAPE), affine)
    return truth, segmented_surface(grid.with_data(enclosed_fractions(truth, grid)))


def test_a_hemisphere_from_its_true_fractions(hemisphere):
    truth, surface = hemisphere
    assert clean(surface.mesh)
    assert (vertex_distances(surface.mesh, truth).mean() + vertex_distances(truth, surface.mesh).mean()) / 2 < 0.2
    n_lost = int(surface.mask.data.sum() - surface.genus_zero_mask.data.sum())
    assert 0 < n_lost < 0.012 * surface.mask.data.sum()


def test_surfaces_go_back_to_the_scanner(hemisphere):
    _, surface = hemisphere
    turned = np.array([[0.96, -0.28, 0, 4], [0.28, 0.96, 0, -9], [0, 0, 1.1, 3], [0, 0, 0, 1]])
    for to_standard in (turned, turned @ FLIPPED):
        scan = StandardScan(surface.distance, to_standard)
        mesh = in_scanner(surface.mesh, scan)
        assert float(signed_volume(mesh)) > 0
        torch.testing.assert_close(scan.from_scanner(mesh.vertices), surface.mesh.vertices, atol=1e-9, rtol=0)
        assert not torch.allclose(mesh.vertices, surface.mesh.vertices)


def test_scans_that_will_not_do_are_refused():
    network, scan = SegmentationNetwork(2, 2), phantom_scan(phantom_surfaces(0), 0)
    for data, message in ((scan.volume.data * 200, r"scaled to \[0, 1\]"), (np.zeros((8, 8, 8)), "scaled to")):
        refuses(message, segment, Volume(data, AFFINE), network)
    refuses("multiple of 2", segment, Volume(np.linspace(0, 1, 7 * 64).reshape(7, 8, 8), AFFINE), network)
    with torch.no_grad():
        network.head.bias.copy_(torch.tensor([1e3, 0, 0]))
    refuses("no white matter on the left", initial_surfaces, scan, network)
    refuses("mask is empty", segmented_surface, Volume(np.full((5, 5, 5), 0.2), np.eye(4)))
    sheared = np.eye(4)
    sheared[0, 1] = 0.3
    refuses("not orthogonal", segmented_surface, Volume(np.pad(np.ones((3, 3, 3)), 4), sheared))
