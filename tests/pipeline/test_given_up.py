"""Pictures of the white matter that the topology step gives up: where they are, and what they say."""

import base64

import numpy as np
import pytest

from meshot.mesh.shapes import icosphere
from meshot.pipeline import page as given_up
from meshot.pipeline.initial_surface import SegmentedSurface
from meshot.pipeline.page import Picture, given_up_pictures
from meshot.pipeline.reconstruction import HemisphereSurface, Reconstruction
from meshot.volume.registration import StandardScan
from meshot.volume.volume import Volume, transform_points

SHIFT = np.array([5.0, -3.0, 2.0])


def reconstruction(pieces):
    """A ball on the left, from whose mask some boxes were cut. The standard space is the scanner's, shifted."""
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = -40.0
    places = np.indices((40, 40, 40)) * 2.0 - 40.0
    mask = (places**2).sum(axis=0) < 30.0**2
    ball = mask.copy()
    for piece in pieces:
        ball[piece] = False
    to_standard = np.eye(4)
    to_standard[:3, 3] = SHIFT
    grid = Volume(mask.astype(float), affine)
    scan = Volume(mask * 100.0, np.linalg.inv(to_standard) @ affine)
    surface = icosphere(4, 30.0)
    surface = surface.with_vertices(transform_points(np.linalg.inv(to_standard), surface.vertices))
    segmented = SegmentedSurface(surface, surface, grid, grid.with_data(mask), grid.with_data(ball))
    sides = {"left": HemisphereSurface(surface, surface, segmented, None)}
    standard = StandardScan(grid, to_standard)
    return Reconstruction(standard, sides, {}, {}, (), None, standard), scan


@pytest.fixture
def seen(monkeypatch):
    """What would be drawn, and where."""
    found = []

    def layer_picture(scan, meshes, plane, through, what):
        found.append((meshes, plane, through, what))
        return Picture("", what)

    monkeypatch.setattr(given_up, "layer_picture", layer_picture)
    return found


FLAT = (slice(14, 26), slice(15, 17), slice(18, 24))  # widest across x and z: coronal
SMALL = (slice(20, 21), slice(24, 27), slice(22, 26))
TINY = (slice(12, 13), slice(20, 23), slice(20, 23))


def test_the_largest_pieces_are_shown_where_they_are_widest(seen):
    found, scan = reconstruction([SMALL, FLAT, TINY])
    assert [picture.alt for picture in given_up_pictures(found, scan)] == [
        "a piece of 1.2 cm³ on the left",
        "a piece of 0.1 cm³ on the left",
    ]  # TINY has nine voxels
    (meshes, plane, through, _), (_, second, _, _) = seen
    assert (plane, second) == ("coronal", "sagittal")
    middle = np.array([2 * 19.5, 2 * FLAT[1].start, 2 * 20.5]) - 40.0 - SHIFT
    np.testing.assert_allclose(through, middle)
    outline = meshes["given up"].vertices.numpy()
    assert (outline.min(axis=0) < through).all()
    assert (through < outline.max(axis=0)).all()


def test_no_more_than_three_are_shown(seen):
    boxes = [(slice(8 + 4 * k, 11 + 4 * k), slice(20, 23), slice(20, 23)) for k in range(5)]
    assert len(given_up_pictures(*reconstruction(boxes))) == 3


def test_nothing_is_shown_where_nothing_was_given_up():
    assert given_up_pictures(*reconstruction([])) == []


def test_a_picture_is_drawn():
    (picture,) = given_up_pictures(*reconstruction([FLAT]))
    assert base64.b64decode(picture.png)[1:4] == b"PNG"
    assert (
        picture.alt
        == "Coronal slice of the scan at y = -7 mm, through a piece of 1.2 cm³ on the left, with its outline"
    )
