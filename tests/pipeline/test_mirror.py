"""A scan and its mirror image give surfaces that are mirror images of each other."""

import numpy as np
import torch

from bright_head import shifting_network
from meshot.mesh.geometry import signed_volume
from meshot.mesh.shapes import icosphere
from meshot.pipeline.mirror import find_both_ways, mirrored, mirrored_mesh, segment_both_ways
from meshot.pipeline.reconstruction import load_networks
from meshot.systems import Part, Scan, SurfaceSystem, get_system
from meshot.volume.volume import Volume, sample_volume

GRID = Volume(
    np.random.default_rng(0).uniform(size=(8, 9, 10)),
    np.array([[2.0, 0, 0, -6.4], [0, 2, 0, -8], [0, 0, 2, -9], [0, 0, 0, 1]]),
)
MIDDLE = 0.6  # of the first axis in mm


def test_a_mesh_is_mirrored_with_its_image():
    mesh = icosphere(2, 3.0, (1.0, -0.5, 0.5))
    there = mirrored_mesh(mesh, GRID)
    torch.testing.assert_close(there.vertices[:, 0], 2 * MIDDLE - mesh.vertices[:, 0])
    values, seen = sample_volume(GRID, mesh.vertices), sample_volume(mirrored(GRID), there.vertices)
    torch.testing.assert_close(values, seen)
    assert float(signed_volume(there)) > 0
    back = mirrored_mesh(there, GRID)
    assert torch.equal(back.faces, mesh.faces)
    torch.testing.assert_close(back.vertices, mesh.vertices)


def ball_scan(image: Volume) -> Scan:
    balls = {("left", "white"): icosphere(2, 2.0, (-3.0, 0, 0)), ("right", "white"): icosphere(3, 1.5, (4.0, 0, 0))}
    return Scan(image, balls)


def test_flows_of_both_sides_are_averaged():
    """Flows by constant ways: that of the other side counts with its x turned round."""
    ways = {"left": (1.0, 2.0, 3.0), "right": (0.5, -1.0, 0.0)}
    system = get_system("windows")({f"{side}_white": Part(shifting_network(way)) for side, way in ways.items()})
    scan = ball_scan(GRID)
    found = find_both_ways(system, scan)
    for side, way in {"left": (0.25, 0.5, 1.5), "right": (-0.25, 0.5, 1.5)}.items():
        moved = found[side, "white"].vertices - scan.initial[side, "white"].vertices
        torch.testing.assert_close(moved, torch.tensor(way, dtype=moved.dtype).expand_as(moved), atol=1e-5, rtol=0)
    # So the mirrored scan has the mirror images.
    turned = Scan(
        mirrored(GRID),
        {
            ("left", "white"): mirrored_mesh(scan.initial["right", "white"], GRID),
            ("right", "white"): mirrored_mesh(scan.initial["left", "white"], GRID),
        },
    )
    there = find_both_ways(system, turned)
    for side, other in (("left", "right"), ("right", "left")):
        expected = mirrored_mesh(found[other, "white"], GRID)
        torch.testing.assert_close(there[side, "white"].vertices, expected.vertices, atol=1e-5, rtol=0)


class OtherFaces(SurfaceSystem):
    """Finds surfaces whose faces depend on the side."""

    name, networks = "other_faces", {}
    surfaces = (("left", "white"), ("right", "white"))
    needs = surfaces

    @classmethod
    def train_parts(cls, examples, settings, run):
        return {}

    def find_surfaces(self, scan):
        return {("left", "white"): icosphere(1), ("right", "white"): icosphere(2)}


def test_surfaces_that_do_not_correspond_stay_as_they_are():
    found = find_both_ways(OtherFaces({}), ball_scan(GRID))
    assert torch.equal(found["left", "white"].vertices, icosphere(1).vertices)
    assert torch.equal(found["right", "white"].vertices, icosphere(2).vertices)


def test_probabilities_of_a_mirrored_scan_are_mirrored():
    network = load_networks().segmentation
    image = Volume(np.random.default_rng(0).uniform(size=(32, 32, 32)).astype(np.float32), np.eye(4))
    found, turned = segment_both_ways(image, network), segment_both_ways(mirrored(image), network)
    for side, other in (("left", "right"), ("right", "left")):
        np.testing.assert_allclose(turned[side].data, found[other].data[::-1], atol=1e-6)
    assert np.abs(found["left"].data - found["right"].data).max() > 1e-3
