"""The floor of a grid: on a sphere it falls with the voxels, and the committed numbers belong together."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from meshot.mesh import icosphere

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "grid_floor"
pytestmark = pytest.mark.usefixtures("one_thread")


def test_a_grid_has_cubic_voxels_and_a_margin_on_every_side(part):
    sphere = icosphere(2, 10.0)
    grid = part("run").grid_around(sphere, 0.7, 3.0)
    first, last = (grid.affine @ [*corner, 1] for corner in ((0, 0, 0), np.array(grid.data.shape) - 1))
    assert np.allclose(np.diag(grid.affine), [0.7, 0.7, 0.7, 1.0])
    low, high = (f(sphere.vertices.numpy(), axis=0) for f in (np.min, np.max))
    assert np.allclose(first[:3], low - 3)
    assert np.all(last[:3] >= high + 3 - 1e-9)
    assert np.all(last[:3] < high + 3 + 0.7)


def test_on_a_sphere_smaller_voxels_are_nearer(part, config):
    sphere = icosphere(4, 12.0)
    own = config | {"n_points": 5000}
    coarse, fine = (part("run").measured(sphere, voxel, own) for voxel in (2.0, 1.0))
    assert 0.01 < coarse["assd_mm_raw"] < 0.2  # a chord of 2 mm on a radius of 12 mm is .04 mm from its arc
    assert fine["assd_mm"] < 0.5 * coarse["assd_mm"]
    assert (coarse["given_up_mm3"], coarse["euler_number"], fine["euler_number"]) == (0, 2, 2)
    assert fine["n_voxels"] > 6 * coarse["n_voxels"]


def test_voxels_that_are_given_up_are_counted_in_mm3(part, config, monkeypatch):
    run = part("run")
    real = run.segmented_surface

    def without_three(volume):
        found = real(volume)
        mask = found.mask.data.copy()
        inside = np.argwhere(mask & found.genus_zero_mask.data)[:3]
        ball = found.genus_zero_mask.data.copy()
        ball[tuple(inside.T)] = False
        return type(found)(found.mesh, found.raw_mesh, found.distance, found.mask, found.mask.with_data(ball))

    monkeypatch.setattr(run, "segmented_surface", without_three)
    found = run.measured(icosphere(3, 8.0), 2.0, config | {"n_points": 100})
    assert found["given_up_mm3"] == 3 * 8


def test_only_the_first_subjects_of_a_kind_are_measured(part, config):
    people = [
        SimpleNamespace(name=f"s{k}", participant=SimpleNamespace(kind=("template", "procedural")[k % 2]))
        for k in range(20)
    ]
    assert list(part("run").chosen(people, config | {"n_subjects": 3})) == ["s0", "s2", "s4"]
    assert len(part("run").chosen(people, config)) == 8


def test_committed_results_belong_together(part, record, results):
    run = part("run")
    config = record["config"]
    rows, lines = results["hemispheres"], run.summary(results["hemispheres"])
    assert len(rows) == config["n_subjects"] * len(config["sides"]) * len(config["voxel_mm"])
    for line, own in zip(results["summary"], lines, strict=True):
        assert line == pytest.approx(own, rel=1e-4)
    assert results["exponent"] == pytest.approx(run.exponent(lines), rel=1e-4)
