"""The table of metrics, and the quality of triangles."""

import dataclasses
import functools
import json
import math
import warnings

import numpy as np
import pytest
import torch

from meshot import evaluate
from meshot.mesh import united
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, folded_sphere, icosphere
from meshot.metrics.distances import Surface
from meshot.metrics.evaluation import (
    Metric,
    edge_length_variation,
    face_area_variation,
    require_same_space,
    smallest_angles,
)
from refusals import refuses

FEW = {"n_points": 4000, "n_emd_points": 300}


@functools.cache
def spheres():
    return evaluate(icosphere(4, 38.0), icosphere(4, 40.0), **FEW)


def test_concentric_spheres():
    found = spheres()
    assert found.assd.value == pytest.approx(2, rel=5e-3)
    assert found.hausdorff.value == pytest.approx(2, rel=1e-2)
    # Sampling adds to squared distances about what two samples of one sphere are apart.
    assert found.swd.value**2 == pytest.approx(4 / 3 + found.swd.floor**2, rel=0.1)
    assert found.emd.value**2 == pytest.approx(4 + found.emd.floor**2, rel=0.1)
    assert found.normals.value == pytest.approx(1, abs=5e-3)
    assert (found.intersecting_faces.value, found.intersecting_share.value, found.euler_number.value) == (0, 0, 2)


def test_a_perfect_prediction_scores_the_floor():
    target = folded_sphere(3)
    for metric in evaluate(target, target, **FEW).metrics():
        assert metric.value == metric.floor, metric.name
    found = evaluate(target, target, **FEW)
    assert found.assd.floor < 1e-10
    assert found.swd.floor > 0.01
    assert found.emd.floor > 1


def test_floors_are_left_out_on_request():
    whole = evaluate(icosphere(3, 11.0), icosphere(3, 10.0), n_points=500, n_emd_points=100)
    found = evaluate(icosphere(3, 11.0), icosphere(3, 10.0), n_points=500, n_emd_points=100, floors=False)
    for metric, other in zip(found.metrics(), whole.metrics(), strict=True):
        assert (metric.value, metric.floor) == (other.value, None), metric.name
        assert other.floor is not None, metric.name
    assert repr(found).splitlines()[1].split()[-1] == "–"


def test_the_seed_decides():
    one, other = icosphere(2, 9.0), icosphere(2, 10.0, dtype=torch.float32).to(torch.float64)
    first, again, another = (repr(evaluate(one, other, **FEW, seed=s)) for s in (0, 0, 1))
    assert first == again != another


@pytest.mark.parametrize("radius", [10.0, 0.1])  # the volume of the second is -0.004
def test_inside_out(radius):
    sphere = icosphere(3, radius)
    with pytest.warns(UserWarning, match="predicted mesh is inside out"):
        found = evaluate(Mesh(sphere.vertices, sphere.faces.flip(1)), sphere, **FEW)
    assert found.signed_normals.value == pytest.approx(-1, abs=1e-6)
    assert found.normals.value == pytest.approx(1, abs=1e-6)


def test_crossing_spheres():
    crossing = united([icosphere(2, 10.0), icosphere(2, 10.0, centre=(5.0, 0.3, 0.2))])
    found = evaluate(crossing, icosphere(2, 10.0), **FEW)
    assert found.intersecting_faces.value > 20
    assert found.intersecting_share.value == pytest.approx(100 * found.intersecting_faces.value / 640)
    assert found.euler_number.value == 4
    assert (found.intersecting_faces.floor, found.euler_number.floor) == (0, 2)


def test_size_and_triangles():
    found = spheres()
    assert found.area.value == pytest.approx(4 * math.pi * 38**2, rel=5e-3)
    assert found.volume.floor == pytest.approx(4 / 3 * math.pi * 40**3, rel=5e-3)
    assert found.edge_variation.value == pytest.approx(edge_length_variation(icosphere(4)))
    assert found.area_variation.floor == pytest.approx(face_area_variation(icosphere(4)))
    assert found.smallest_angle.value == pytest.approx(smallest_angles(icosphere(4)).mean())


def test_blurred_transport_is_labelled_and_close():
    blurred = evaluate(icosphere(4, 38.0), icosphere(4, 40.0), **FEW, emd_blur=1.0).emd
    assert blurred.value == pytest.approx(spheres().emd.value, rel=0.05)
    assert "blur of 1.0 mm between 300 points" in blurred.definition


def test_surfaces_in_other_spaces():
    sphere = icosphere(2, 10.0)
    refuses(r"do not overlap.*scanner RAS", evaluate, sphere, icosphere(2, 10.0, centre=(0.0, 25.0, 0.0)), **FEW)
    with pytest.warns(UserWarning, match=r"share 4\d%.*same hemisphere"):
        evaluate(sphere, icosphere(2, 10.0, centre=(0.0, 14.0, 0.0)), **FEW)


def test_other_units_are_refused_or_warned_of():
    sphere = icosphere(2, 40.0)
    refuses(r"extend over 0.1386 and 138.6; .* in mm", evaluate, icosphere(2, 0.04), sphere, **FEW)
    with pytest.warns(UserWarning, match=r"extend over 138.6 and 55.43"):
        evaluate(sphere, icosphere(2, 16.0), **FEW)


@pytest.mark.parametrize(("ratio", "outcome"), [(1.999, "none"), (2, "warns"), (9.99, "warns"), (10, "refuses")])
def test_from_which_ratio_on(ratio, outcome):
    """Of the diagonals of two boxes, here 13 and 13 times the ratio: exact numbers."""
    box = cube().with_vertices(cube().vertices * torch.tensor([3.0, 4, 12], dtype=torch.float64))
    pair = Surface(box), Surface(box.with_vertices(box.vertices * ratio))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if outcome == "refuses":
            refuses("extend over 13 and 130", require_same_space, *pair)
        else:
            require_same_space(*pair)
    assert len(caught) == (outcome == "warns")


DAMAGED = {
    "is open": lambda m: Mesh(m.vertices, m.faces[5:]),
    "of more than two faces": lambda m: Mesh(
        torch.cat([m.vertices, m.vertices[:1] * 2]), torch.cat([m.faces, torch.tensor([[*m.faces[0, :2], 162]])])
    ),
    "look to opposite sides": lambda m: Mesh(m.vertices, torch.cat([m.faces[:1].flip(1), m.faces[1:]])),
}


@pytest.mark.parametrize("words", DAMAGED)
def test_damaged_meshes_are_measured_with_a_warning(words):
    sphere = icosphere(2, 10.0)
    with pytest.warns(UserWarning, match=f"predicted mesh .*{words}.* distances are valid"):
        found = evaluate(DAMAGED[words](sphere), sphere, **FEW)
    assert found.assd.value < 0.3
    with pytest.warns(UserWarning, match=f"target mesh .*{words}"):
        evaluate(sphere, DAMAGED[words](sphere), **FEW)


def test_vertices_that_are_not_numbers_are_refused():
    sphere = icosphere(1)
    gone = sphere.with_vertices(sphere.vertices.clone().index_fill(0, torch.tensor([4]), torch.nan))
    for pair in ((gone, sphere), (sphere, gone)):
        refuses(r"NaN or infinite, the first at index \(4, 0\)", evaluate, *pair, **FEW)


def test_a_surface_without_area_is_refused():
    flat = Mesh(torch.zeros(3, 3, dtype=torch.float64), torch.tensor([[0, 1, 2]]))
    refuses("extend over 0 and", evaluate, flat, icosphere(1), **FEW)


def test_table_and_definitions_say_everything():
    found = spheres()
    lines = repr(found).splitlines()
    assert lines[0].split() == ["metric", "value", "unit", "floor"]
    assert len(lines) == 15
    assert f"{found.assd.value:.4g}" in lines[3]
    assert "300 points" in found.emd.definition
    assert "4000 points" in found.definitions()
    assert "{" not in found.definitions()


def test_is_plain_data():
    found = spheres()
    data = json.loads(json.dumps(found.as_dict()))
    assert type(found)(**{name: Metric(**entry) for name, entry in data.items()}) == found
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.emd = found.swd


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"n_points": 0}, "n_points is 0"),
        ({"n_emd_points": 0}, "n_emd_points is 0"),
        ({"n_points": 10, "n_emd_points": 11}, "above n_points = 10"),
    ],
)
def test_doors(arguments, words):
    refuses(words, evaluate, icosphere(0), icosphere(0), **arguments)


def triangle(a, b, c):
    return Mesh(torch.tensor([a, b, c], dtype=torch.float64), torch.tensor([[0, 1, 2]]))


def test_a_3_4_5_triangle():
    mesh = triangle((0, 0, 0), (4, 0, 0), (0, 3, 0))
    np.testing.assert_allclose(smallest_angles(mesh), math.degrees(math.atan(3 / 4)))
    assert edge_length_variation(mesh) == pytest.approx(math.sqrt(2 / 3) / 4)


def test_a_cube_of_halved_squares():
    # 12 edges of length 1, 6 diagonals of length √2.
    lengths = [1.0] * 12 + [math.sqrt(2)] * 6
    assert edge_length_variation(cube()) == pytest.approx(np.std(lengths) / np.mean(lengths))
    np.testing.assert_allclose(smallest_angles(cube()), 45)


def test_two_areas():
    mesh = Mesh(
        torch.tensor([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 9), (3, 0, 9), (0, 1, 9)], dtype=torch.float64),
        torch.tensor([[0, 1, 2], [3, 4, 5]]),
    )
    assert face_area_variation(mesh) == pytest.approx(0.5)  # areas ½ and 1½


def test_sizes_do_not_matter_and_faces_without_area_are_zero():
    small, large = icosphere(3), icosphere(3, 40.0)
    assert edge_length_variation(small) == pytest.approx(edge_length_variation(large))
    flat = triangle((0, 0, 0), (1, 0, 0), (2, 0, 0))
    assert smallest_angles(flat) == pytest.approx(0)
    assert face_area_variation(flat) == 0
