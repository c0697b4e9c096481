"""The protocol of thickness on surfaces whose answer is known: spheres, fsaverage5, and rows made by hand."""

from pathlib import Path

import numpy as np
import pytest

from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.shapes import icosphere

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "thickness"
CONFIG = {"n_points": 4000, "beyond_mm": 2.0, "seed": 0}


def test_spheres_have_the_measures_of_spheres(run):
    found = run.compared(icosphere(5, radius=29.0), icosphere(5, radius=30.0), CONFIG)
    assert found["assd_mm"] == pytest.approx(1, abs=0.01)
    assert found["signed_mm"] == pytest.approx(-1, abs=0.01)
    assert found["beyond_percent"] == 0
    assert found["normals"] == pytest.approx(1, abs=0.001)
    assert found["area_percent"] == pytest.approx(100 * ((29 / 30) ** 2 - 1), abs=0.01)


def test_the_truth_has_no_error(run):
    white, pial = (fsaverage5_surface(kind, "left") for kind in ("white", "pial"))
    truths, template = {"white": white, "pial": pial}, run.template_in_place(white, "left")
    found = run.measured(white, pial, truths, template, "left", CONFIG)
    assert found["thickness_error_mm"] == 0
    assert set(found["region_error_mm"].values()) == {0.0}
    assert len(found["region_error_mm"]) == 34
    assert found["pial"]["assd_mm"] < 0.01
    farther = pial.with_vertices(pial.vertices + 0.5 * (pial.vertices - white.vertices))
    thick = run.measured(white, farther, truths, template, "left", CONFIG)
    assert thick["thickness_mm"] > found["thickness_mm"] + 0.5
    assert all(error > 0.1 for error in thick["region_error_mm"].values())


def side(pial, baseline):
    return {
        name: {
            "white": dict.fromkeys(MEASURES, 0.3), "pial": dict.fromkeys(MEASURES, assd),
            "thickness_error_mm": 0.1 * assd, "region_error_mm": {"insula": assd},
        }
        for name, assd in (("flows", pial), ("baseline", baseline))
    }  # fmt: skip


def head(pial, baseline, crossing=0):
    sides = {"left": side(pial, baseline), "right": side(pial + 0.2, baseline)}
    return {"sides": sides, "crossing_of_four": crossing}


MEASURES = ("assd_mm", "hausdorff90_mm", "beyond_percent", "signed_mm", "normals", "area_percent")


def test_flows_ship_if_they_are_better_and_their_surfaces_keep_apart(run):
    random = np.random.default_rng(0)
    better = [head(0.3 + 0.02 * random.normal(), 0.6) for _ in range(24)]
    found = run.summarised(better)
    assert found["ships"]
    assert found["flows"]["pial"]["assd_mm"]["mean"] == pytest.approx(0.4, abs=0.02)
    assert found["flows"]["region_error_mm"]["insula"] == pytest.approx(0.4, abs=0.02)
    assert found["difference_mm"]["mean"] == pytest.approx(-0.2, abs=0.02)
    touching = [dict(row, crossing_of_four=3) if k < 3 else row for k, row in enumerate(better)]
    assert run.summarised(touching)["n_without_crossing"] == 21  # of 24, and nine of ten are needed
    assert not run.summarised(touching)["ships"]
    even = [head(0.5 + 0.2 * random.normal(), 0.6) for _ in range(24)]
    assert not run.summarised(even)["ships"]
