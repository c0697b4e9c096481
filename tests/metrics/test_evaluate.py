import dataclasses
import functools
import json
import math

import pytest
import torch

from meshot import evaluate
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import folded_sphere, icosphere
from meshot.metrics.evaluation import Metric
from meshot.metrics.triangles import edge_length_variation, face_area_variation, smallest_angles

FEW = {"n_points": 4000, "n_emd_points": 300}


@functools.cache
def spheres():
    return evaluate(icosphere(4, 38.0), icosphere(4, 40.0), **FEW)


def merged(one, other):
    return Mesh(torch.cat([one.vertices, other.vertices]), torch.cat([one.faces, other.faces + len(one.vertices)]))


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


def test_the_seed_decides():
    one, other = icosphere(2, 9.0), icosphere(2, 10.0, dtype=torch.float32).to(torch.float64)
    first, again, another = (repr(evaluate(one, other, **FEW, seed=s)) for s in (0, 0, 1))
    assert first == again != another


def test_inside_out():
    sphere = icosphere(3, 10.0)
    found = evaluate(Mesh(sphere.vertices, sphere.faces.flip(1)), sphere, **FEW)
    assert found.signed_normals.value == pytest.approx(-1, abs=1e-6)
    assert found.normals.value == pytest.approx(1, abs=1e-6)


def test_crossing_spheres():
    crossing = merged(icosphere(2, 10.0), icosphere(2, 10.0, centre=(5.0, 0.3, 0.2)))
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
    with pytest.raises(ValueError, match=r"do not overlap.*scanner RAS"):
        evaluate(sphere, icosphere(2, 10.0, centre=(0.0, 25.0, 0.0)), **FEW)
    with pytest.warns(UserWarning, match=r"share 4\d%.*same hemisphere"):
        evaluate(sphere, icosphere(2, 10.0, centre=(0.0, 14.0, 0.0)), **FEW)


def test_table_and_definitions_say_everything():
    found = spheres()
    lines = repr(found).splitlines()
    assert lines[0].split() == ["metric", "value", "unit", "floor"]
    assert len(lines) == 15
    assert "average symmetric surface distance  " in repr(found)
    assert f"{found.assd.value:.4g}" in lines[3]
    assert "300 points" in found.emd.definition
    assert "4000 points" in found.definitions()
    assert "{" not in found.definitions()
    assert all(metric.unit in ("mm", "mm²", "mm³", "%", "faces", "degrees", "") for metric in found.metrics())


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
    with pytest.raises(ValueError, match=words):
        evaluate(icosphere(0), icosphere(0), **arguments)
