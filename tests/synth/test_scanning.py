"""A simulated scan against its surfaces, its position in the scanner, and the way to the standard grid and back."""

import functools

import nibabel
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from meshot.anatomy import templates as placement
from meshot.anatomy.templates import ENLARGEMENT, _template_moments, in_mni152, moments_of
from meshot.mesh.geometry import face_normals
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.synth.cohorts import LABELS
from meshot.synth.imaging import Appearance
from meshot.synth.scanning import (
    Anatomy,
    Position,
    head_position,
    rounded,
    scanner_grid,
    simulated_scan,
    standardised,
    surface_facts,
)
from meshot.synth.subject import CorticalSurfaces
from meshot.volume.registration import SHAPE
from meshot.volume.volume import mm_to_voxel, sample_volume, transform_points, voxel_sizes
from refusals import refuses

SIGNAL = {"white": 440.0, "grey": 310.0, "deep grey": 360.0, "hindbrain": 365.0, "fluid": 110.0} | {
    "skull": 60.0,
    "scalp": 480.0,
}
PLAIN = Appearance(SIGNAL, texture=0.0, bias=0.0, blur_mm=0.0, noise=0.0)
OBLIQUE = Position(oblique_degrees=10.0, voxel_mm=(1.5, 1.7, 2.0), orientation="RAS")
FLIPPED = Position(voxel_mm=(2.0, 1.5, 1.7), orientation="LSP")
CENTRES = {"left": (-37.0, -18.0, 14.0), "right": (37.0, -18.0, 14.0)}


@functools.cache
def subject():
    """Two balls of cortex, nearly as large as hemispheres."""
    white, pial = ({side: icosphere(4, radius, centre) for side, centre in CENTRES.items()} for radius in (31.0, 35.0))
    wall = {side: torch.zeros(len(white[side].vertices), dtype=torch.bool) for side in white}
    return CorticalSurfaces(white, pial, wall)


@functools.cache
def scan(position=OBLIQUE, appearance=None, anatomy=None, seed=0):
    return simulated_scan(subject(), anatomy or Anatomy(), appearance or PLAIN, position, [seed])


@pytest.mark.parametrize("position", [OBLIQUE, FLIPPED], ids=["oblique", "flipped"])
def test_the_image_changes_where_the_surfaces_are(position):
    found = scan(position)
    for kind, inner, outer in (("white", 440, 310), ("pial", 310, 0)):
        mesh = found.surfaces[kind, "left"]
        normals = face_normals(mesh)
        middles = mesh.vertices[mesh.faces].mean(dim=1)
        # Away from the other hemisphere and from the hindbrain.
        away = (middles - mesh.vertices.mean(dim=0)) @ torch.from_numpy(found.head_to_scanner[:3, :3])
        side = (away[:, 0] < 5) & (away[:, 2] > 0)
        at, before = (float(sample_volume(found.image, (middles + d * normals)[side]).mean()) for d in (0.0, -1.7))
        assert at == pytest.approx((inner + outer) / 2, abs=0.12 * (inner - outer))
        assert before > at + 0.25 * (inner - outer)


def test_the_head_moves_rigidly_and_vertices_are_round_numbers():
    found = scan()
    for (kind, side), mesh in found.surfaces.items():
        head = getattr(subject(), kind)[side].vertices
        torch.testing.assert_close(transform_points(found.head_to_scanner, head), mesh.vertices, atol=1e-4, rtol=0)
        assert torch.equal(mesh.vertices.float().double(), mesh.vertices)  # a file keeps them whole
    assert found.image.data.dtype == np.int16


def test_labels_say_what_fills_a_voxel():
    found = scan(anatomy=Anatomy(ventricles=0.0))
    labels, image = found.tissue.data, found.image.data
    voxel = abs(np.linalg.det(found.image.affine[:3, :3]))
    for side in ("left", "right"):
        white, grey = ((labels == LABELS[f"{side} {tissue}"]).sum() * voxel for tissue in ("white", "grey"))
        deep = (labels == LABELS["deep grey"]).sum() * voxel / 2
        assert white + deep == pytest.approx(4 / 3 * np.pi * 31**3, rel=0.05)
        assert grey == pytest.approx(4 / 3 * np.pi * (35**3 - 31**3), rel=0.12)
    for name, signal in (("left white", 440), ("right white", 440), ("hindbrain", 365)):
        assert np.median(image[labels == LABELS[name]]) == signal
    assert np.median(image[labels == 0]) == 0
    left = found.surfaces["white", "left"].vertices.mean(dim=0, keepdim=True)
    assert float(sample_volume(found.tissue.with_data((labels == 1).astype(float)), left)) == pytest.approx(1)


def test_a_skull_goes_around_the_brain():
    found = scan(anatomy=Anatomy(head_mm=(3.0, 5.0, 6.0)))
    around = {name: (found.tissue.data == LABELS[name]).sum() for name in ("fluid", "skull", "scalp")}
    assert min(around.values()) > 500
    assert around["scalp"] > around["skull"] > around["fluid"]
    edge = found.tissue.data.copy()
    edge[1:-1, 1:-1, 1:-1] = 0
    assert not edge.any()  # the grid holds all of the head


@pytest.mark.parametrize("position", [OBLIQUE, FLIPPED], ids=["oblique", "flipped"])
def test_surfaces_go_to_the_standard_grid_and_come_back(position):
    found = scan(position)
    standard, labels = standardised(found, registration_mm=8)
    assert standard.volume.data.shape == labels.data.shape == SHAPE
    assert (standard.volume.data * 2**12 == np.rint(standard.volume.data * 2**12)).all()
    for label, side in enumerate(("left", "right"), start=1):
        vertices = found.surfaces["white", side].vertices
        there = standard.from_scanner(vertices)
        assert (there - vertices).norm(dim=1).mean() > 1
        back = standard.to_scanner(there.float()).double()
        assert float((back - vertices).norm(dim=1).max()) < 0.01
        centre = there.mean(dim=0, keepdim=True)
        inside = labels.with_data((labels.data == label).astype(float))
        assert float(sample_volume(inside, centre)) == pytest.approx(1)
        volume = inside.data.sum() * abs(np.linalg.det(labels.affine[:3, :3]))
        shrink = np.linalg.det(standard.to_standard[:3, :3])
        assert volume == pytest.approx(4 / 3 * np.pi * 31**3 * shrink, rel=0.02)


def test_the_true_white_matter_may_place_a_scan_on_the_standard_grid(monkeypatch):
    monkeypatch.setattr(placement, "PLAUSIBLE_SCALES", (0.1, 9.0))  # two balls have not the shape of white matter
    found = scan(OBLIQUE)
    before, _ = standardised(found, 8)
    placed, labels = standardised(found, 8, by_white_matter=True)
    moments, target = moments_of(labels), _template_moments()
    mean = in_mni152(Mesh(torch.tensor(moments.mean).expand(3, 3), torch.tensor([[0, 1, 2]]))).vertices[0]
    np.testing.assert_allclose(mean.numpy(), target.mean, atol=0.5)
    lengths, expected = (np.linalg.eigvalsh(each.covariance) ** 0.5 for each in (moments, target))
    np.testing.assert_allclose(lengths, ENLARGEMENT * expected, rtol=0.02)
    assert not np.allclose(placed.to_standard, before.to_standard, atol=0.05)


def test_facts_of_spheres():
    facts = surface_facts(scan(), subject())
    assert facts["left white"]["area_cm2"] == pytest.approx(4 * np.pi * 3.1**2, rel=0.01)
    assert facts["right pial"]["volume_ml"] == pytest.approx(4 / 3 * np.pi * 3.5**3, rel=0.01)
    assert facts["left pial"]["crossing_faces"] == 0
    assert facts["right thickness_mm"] == {"p5": 4.0, "median": 4.0, "p95": 4.0}


def test_numbers_are_rounded_wherever_they_are():
    assert rounded({"a": [1 / 3, (2 / 3, "x", 7)], "b": True}) == {"a": [0.333333, [0.666667, "x", 7]], "b": True}
    assert rounded(float("nan")) is None


def test_the_motion_is_rigid_and_within_its_bounds():
    position, centre = Position(rotation_degrees=10, translation_mm=5), np.array([0.0, -20.0, 15.0])
    for seed in range(20):
        motion = head_position(position, centre, seed)
        np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(motion[:3, :3]) == pytest.approx(1)
        shift = motion[:3, :3] @ centre + motion[:3, 3] - centre
        assert np.abs(shift).max() <= 5
        assert np.abs(Rotation.from_matrix(motion[:3, :3]).as_euler("xyz", degrees=True)).max() <= 10 + 1e-9
    np.testing.assert_array_equal(head_position(position, centre, 3), head_position(position, centre, 3))
    assert not np.allclose(head_position(position, centre, 3), head_position(position, centre, 4))
    still = head_position(Position(rotation_degrees=0, translation_mm=0), centre, 0)
    np.testing.assert_allclose(still, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("letters", ["RAS", "LAS", "PSR", "AIL", "SRP"])
@pytest.mark.parametrize("oblique", [0.0, 15.0])
def test_the_grid_holds_everything_and_points_where_its_letters_say(letters, oblique):
    points = torch.from_numpy(np.random.default_rng(0).uniform([-60, -90, -40], [70, 70, 80], (500, 3)))
    position = Position(oblique_degrees=oblique, voxel_mm=(1.0, 1.5, 2.0), orientation=letters, margin_mm=7.0)
    grid = scanner_grid(position, points, 1)
    np.testing.assert_allclose(voxel_sizes(grid), [1.0, 1.5, 2.0], rtol=1e-6)
    places = mm_to_voxel(grid, points).numpy() * voxel_sizes(grid)
    ends = (np.array(grid.data.shape) - 1) * voxel_sizes(grid)
    assert (places > 7 - 1e-3).all()
    assert (places < ends - 7 + 1e-3).all()
    assert (places.min(axis=0) < 7 + 2.01).all()  # and not much more than that
    assert "".join(nibabel.aff2axcodes(grid.affine)) == letters
    if oblique:
        assert np.count_nonzero(np.abs(grid.affine[:3, :3]) > 1e-3) == 9
    assert (grid.affine == grid.affine.astype(np.float32)).all()  # a header keeps no more


@pytest.mark.parametrize(
    ("knobs", "words"),
    [
        ({"rotation_degrees": 45.0}, "0 to 30"),
        ({"oblique_degrees": -1.0}, "0 to 30"),
        ({"translation_mm": 1e6}, "0 to 100 mm"),
        ({"voxel_mm": (1.0, 1.0)}, "three sizes"),
        ({"voxel_mm": (1.0, 1.0, 0.0)}, "three sizes"),
        ({"margin_mm": -1.0}, "margin_mm"),
        ({"orientation": "RAP"}, "one letter of each"),
        ({"orientation": "RA"}, "one letter of each"),
        ({"orientation": "RASX"}, "one letter of each"),
    ],
)
def test_doors(unchecked, knobs, words):
    refuses(words, Position, **knobs)
