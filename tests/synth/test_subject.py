"""Synthetic subjects: their topology, that nothing crosses, and what each knob does."""

import numpy as np
import pytest
import torch

import meshot.synth.subject
from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.synth.subject import (
    LATTICE,
    CorticalSurfaces,
    Shape,
    crossing_faces,
    mean_surfaces,
    synthetic_subject,
    template_cortex,
)
from refusals import refuses

SMALL = Shape(subdivisions=5, folding=1.0)  # 10 242 vertices
ONE = torch.ones(10_242, dtype=torch.float64)
#: Edges twice as long as in a whole subject call for shallower folds.
SHALLOW = Shape("procedural", subdivisions=5, folding=0.7, warp_mm=(2.0, 1.0))


@pytest.fixture(scope="module")
def template() -> CorticalSurfaces:
    return synthetic_subject(SMALL, 0)


@pytest.fixture(scope="module")
def procedural() -> CorticalSurfaces:
    return synthetic_subject(SHALLOW, 0)


@pytest.fixture(params=["template", "procedural"])
def subject(request) -> CorticalSurfaces:
    return request.getfixturevalue(request.param)


def test_every_surface_is_a_sphere_turned_outward(subject):
    for mesh in subject.meshes():
        assert topology(mesh) == SPHERE
        assert len(mesh.vertices) == 10_242
        assert float(signed_volume(mesh)) > 0


def test_no_two_faces_of_any_surface_cross(subject):
    assert not len(crossing_faces(subject.meshes()))
    left, right = subject.pial["left"].vertices, subject.pial["right"].vertices
    left, right = left.mean(dim=0)[0], right.mean(dim=0)[0]
    assert left < -15 < 15 < right
    for side in HEMISPHERES:  # nested: the pial surface encloses more
        assert float(signed_volume(subject.pial[side])) > 1.1 * float(signed_volume(subject.white[side]))


def test_size_and_thickness_are_those_of_a_cortex(subject):
    for side in HEMISPHERES:
        thickness = subject.thickness(side)
        assert torch.equal(thickness.isnan(), subject.wall[side])
        thickness = thickness[~subject.wall[side]].numpy()
        assert 2 < np.median(thickness) < 3
        assert np.quantile(thickness, 0.95) < 4.8
        assert 0.01 < float(subject.wall[side].double().mean()) < 0.1
        apart = (subject.pial[side].vertices - subject.white[side].vertices).norm(dim=1)
        assert 0 < float(apart[subject.wall[side]].median()) < 0.6
        assert 25_000 < float(face_areas(subject.white[side]).sum()) < 110_000
        assert 400_000 < float(signed_volume(subject.pial[side])) < 700_000


def test_coordinates_lie_on_the_lattice(subject):
    for mesh in subject.meshes():
        assert torch.equal(mesh.vertices.float().double(), mesh.vertices)
        assert not (mesh.vertices / LATTICE % 1).any()


def test_the_mean_is_the_template_moved_from_the_midline():
    mean = mean_surfaces(SMALL)
    assert mean.strength == 1
    apart = (mean.white["left"].vertices - fsaverage5_surface("white", "left").vertices)[:, 0]
    assert float(apart.median()) == pytest.approx(-1, abs=1e-3)
    assert vertex_distances(mean.white["left"], template_cortex("left", 5, ONE, ONE, 0.0)[0]).mean() < 0.02
    assert float(mean.thickness("left").nanmedian()) == pytest.approx(SMALL.thickness, abs=0.03)


def test_the_mean_shape_has_no_variation():
    shape = SMALL.without_variation()
    assert shape.warp_mm == ()
    assert shape.size_sd == shape.folding_sd == shape.thickness_variation == shape.atrophy_sd == 0
    assert shape.folding == SMALL.folding


def test_atrophy_shrinks_white_matter_and_not_the_cortex():
    (white, pial, wall), (less, its_pial, _) = (template_cortex("left", 5, ONE, ONE, mm) for mm in (0.0, 0.4))
    lost = float(signed_volume(white) - signed_volume(less))
    assert lost == pytest.approx(0.4 * float(face_areas(white).sum()), rel=0.2)
    apart, still_apart = ((p.vertices - w.vertices)[~wall].norm(dim=1) for w, p in ((white, pial), (less, its_pial)))
    assert torch.allclose(apart, still_apart, atol=0.11)


def test_knobs_turn_what_they_name():
    plain, deep, thin = (template_cortex("left", 5, a * ONE, b * ONE, 0.0) for a, b in ((1, 1), (1.2, 1), (1, 0.8)))
    areas = [float(face_areas(white).sum()) for white, _, _ in (plain, deep)]
    assert areas[1] > 1.1 * areas[0]
    medians = [float((p.vertices - w.vertices)[~wall].norm(dim=1).median()) for w, p, wall in (plain, thin)]
    assert medians[1] / medians[0] == pytest.approx(0.8, rel=0.03)


def test_a_draw_that_crosses_is_made_weaker(monkeypatch):
    attempts = []

    def reluctant(meshes):
        attempts.append(meshes)
        return meshes if len(attempts) == 3 else None

    monkeypatch.setattr(meshot.synth.subject, "kept_apart", reluctant)
    assert synthetic_subject(SMALL, 0).strength == 0.4
    first, second = (a[0].vertices - attempts[2][0].vertices for a in attempts[:2])
    assert first.norm(dim=1).mean() > second.norm(dim=1).mean() > 0.1
    monkeypatch.setattr(meshot.synth.subject, "kept_apart", lambda _: None)
    refuses("cross even without variation", synthetic_subject, SMALL.without_variation(), 0)


@pytest.mark.parametrize(
    ("knobs", "said"),
    [
        ({"kind": "dog"}, "kind is 'dog'"),
        ({"subdivisions": 4}, "subdivisions is 4; an integer from 5"),
        ({"subdivisions": 8}, "subdivisions is 8"),
        ({"kind": "procedural", "subdivisions": 4}, "integer from 5"),
        ({"warp_mm": (1.0, -1.0)}, "warp_mm is -1.0"),
        ({"size_sd": float("nan")}, "size_sd is nan"),
        ({"folding": 2.0}, "folding is 2.0"),
        ({"thickness": 0.5}, "thickness is 0.5"),
        ({"atrophy": 3.0}, "atrophy is 3.0"),
    ],
)
def test_impossible_shapes_are_refused(unchecked, knobs, said):
    refuses(said, Shape, **knobs)


def test_surfaces_that_do_not_belong_together_are_refused(unchecked):
    ball = icosphere(1)
    both, wall = dict.fromkeys(HEMISPHERES, ball), {side: torch.zeros(42, dtype=torch.bool) for side in HEMISPHERES}
    refuses(r"pial has \['left'\]", CorticalSurfaces, both, {"left": ball}, wall)
    refuses("faces of the right", CorticalSurfaces, both, {"left": ball, "right": icosphere(2)}, wall)
    with pytest.raises(ValueError, match="left wall names 3 vertices"):
        CorticalSurfaces(both, both, wall | {"left": torch.zeros(3, dtype=torch.bool)})


def test_a_mirrored_subject_is_the_mirror_image_before_its_warp(unchecked):
    still = {"subdivisions": 5, "size_sd": 0.0, "warp_mm": (), "folding_sd": 0.0, "thickness_sd": 0.0}
    plain, mirrored = (synthetic_subject(Shape(**still, mirrored=flag), 3) for flag in (False, True))
    flip = torch.tensor([-1.0, 1.0, 1.0], dtype=torch.float64)
    for side, other in (("left", "right"), ("right", "left")):
        for kind in ("white", "pial"):
            one, two = getattr(plain, kind)[side], getattr(mirrored, kind)[other]
            assert float((one.vertices * flip - two.vertices).norm(dim=1).median()) < 1e-3
            assert float(signed_volume(two)) > 0
        assert torch.equal(plain.wall[side], mirrored.wall[other])
    refuses("mirrored is 2", Shape, mirrored=2)
