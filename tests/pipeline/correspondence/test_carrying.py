"""Vertices that correspond between people: carried to a known deformation of the template, and written."""

import functools
import json

import numpy as np
import pytest
import pyvista
import torch
import trimesh

from bright_head import bright_template, write_bright_weights
from meshot.anatomy.templates import fsaverage5_surface
from meshot.cli import main
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.io import read_mesh
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.pipeline import correspondence as carrying, reconstruction, reconstruction as placing, report as files
from meshot.pipeline.correspondence import carry_template
from meshot.volume.io import write_volume


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """The result then repeats."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def bent(points: torch.Tensor) -> torch.Tensor:
    """Some 4 mm of smooth deformation that no affine map has."""
    x, y, z = points.T
    return points + torch.stack([4 * torch.sin(y / 18), 4 * torch.sin(z / 15), 4 * torch.sin((x + y) / 20)], dim=1)


@pytest.fixture(scope="module")
def carried():
    template = fsaverage5_surface("white", "left", "MNI152")
    goal = template.with_vertices(bent(template.vertices))
    return template, goal, carry_template(goal, "left", (24, 24))


def test_vertices_come_near_their_true_places(carried):
    template, goal, found = carried
    before = (template.vertices - goal.vertices).norm(dim=1).mean()
    after = (found.mesh.vertices - goal.vertices).norm(dim=1).mean()
    assert before > 4
    assert after < 0.5 * before
    assert torch.equal(found.mesh.faces, template.faces)


def test_the_distance_is_that_of_the_surfaces_and_no_faces_cross(carried):
    _, goal, found = carried
    sides = [pyvista.make_tri_mesh(each.vertices.numpy(), each.faces.numpy()) for each in (found.mesh, goal)]
    points = [
        trimesh.sample.sample_surface(trimesh.Trimesh(*each, process=False), 3000, seed=0)[0]
        for each in ((mesh.vertices.numpy(), mesh.faces.numpy()) for mesh in (found.mesh, goal))
    ]
    measured = [pyvista.PolyData(points[k]).compute_implicit_distance(sides[1 - k]) for k in (0, 1)]
    ways = [np.abs(each["implicit_distance"]).mean() for each in measured]
    assert found.distance_mm == pytest.approx(np.mean(ways), rel=0.08)  # twice three deviations of 3000 points
    assert found.n_crossing == len(self_intersecting_faces(found.mesh)) == 0


def test_the_result_is_the_same_again(carried):
    first, again = (carry_template(carried[1], "left", (3, 3)) for _ in range(2))
    assert torch.equal(again.mesh.vertices, first.mesh.vertices)


def test_crossings_that_cannot_be_smoothed_are_counted(monkeypatch):
    goal = fsaverage5_surface("white", "right", "MNI152")
    monkeypatch.setattr(carrying, "smooth_crossings", lambda mesh: (_ for _ in ()).throw(ValueError("no")))
    monkeypatch.setattr(carrying, "_RATES", (20.0, 20.0))
    found = carry_template(goal, "right", (6, 1))
    assert found.n_crossing == found.n_crossing_before == len(self_intersecting_faces(found.mesh)) > 0


def test_a_surface_elsewhere_is_refused():
    with pytest.raises(ValueError, match=r"centre of the surface is at \[40\.0, 1\.0, 2\.0\] mm, outside the box"):
        carry_template(icosphere(2, 30.0, (40.0, 1.0, 2.0)), "left")


def test_the_command_writes_it_and_prints_its_distance(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(reconstruction, "mni152_t1", bright_template)
    monkeypatch.setattr(placing, "carry_template", functools.partial(carry_template, n_iterations=(4, 4)))
    weights = write_bright_weights(tmp_path / "weights")
    write_volume(tmp_path / "head.nii.gz", bright_template())
    words = ["--system", "ddot", "--weights", str(weights), "--segmentation", str(weights / "segmentation.safetensors")]
    assert main(["reconstruct", str(tmp_path / "head.nii.gz"), "-o", str(tmp_path / "out"), *words, "--template"]) == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    said = capsys.readouterr().out
    for side, short in files.SHORT.items():
        mesh = read_mesh(tmp_path / "out" / f"{short}.fsaverage5.surf.gii")
        white = read_mesh(tmp_path / "out" / f"{short}.white.surf.gii")
        ways = [vertex_distances(mesh, white).mean(), vertex_distances(white, mesh).mean()]
        numbers = report["surfaces"][side]["fsaverage5"]
        # In MNI152 and in the scanner, which have the same scale here up to the registration.
        assert numbers["distance_mm"] == pytest.approx(np.mean(ways), rel=0.1)
        assert f"{side}: fsaverage5 carried to it lies {numbers['distance_mm']:.2f} mm away (ASSD)" in said
        assert torch.equal(mesh.faces, fsaverage5_surface("white", side).faces)
        assert f"template, {side}" in report["seconds"]["clock"]
    assert "distance of fsaverage5 carried here" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
