"""The flows to fsaverage5: stored flows lead where they say, and a slice runs again."""

from pathlib import Path

import numpy as np
import pytest
import torch

from meshot.flow.fields import grid_around
from meshot.mesh.connectivity import SPHERE, self_intersecting_faces, topology
from meshot.mesh.geometry import edge_lengths
from meshot.mesh.shapes import icosphere
from meshot_book.flows import Affine, Leg, chain_trajectory
from refusals import refuses

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "fsaverage5_flow"


@pytest.mark.parametrize("start", ["near", "far"])
def test_no_faces_cross_before_a_fit(part, config, start):
    target, begin = (
        part("surfaces").target_surface("right"),
        part("surfaces").start_surface("right", config["starts"][start]),
    )
    assert topology(begin) == SPHERE
    assert len(self_intersecting_faces(begin)) == len(self_intersecting_faces(target)) == 0


def test_edges_are_cut_where_the_chain_stretches_them(part):
    sphere = icosphere(2)
    # One Euler step with this field makes x three times as long.
    legs = [Leg(Affine(torch.diag(torch.tensor([2.0, 0.0, 0.0], dtype=torch.float64))), 1)]
    longest = float(edge_lengths(sphere).max())
    cut = part("surfaces").cut_where_stretched(sphere, legs, longest)
    assert float(edge_lengths(part("surfaces").carried(legs, cut)).max()) <= longest
    assert len(sphere.faces) < len(cut.faces) < 16 * len(sphere.faces)
    assert topology(cut) == SPHERE
    assert torch.equal(part("surfaces").cut_where_stretched(sphere, [], longest).faces, sphere.faces)


def test_a_short_leg_runs_stops_and_goes_on(part, config, tmp_path):
    fitting, surfaces = part("fitting"), part("surfaces")
    leg = config["tasks"]["sliced"]["legs"][0] | {"n_iterations": 4, "spacings": [24.0, 12.0], "n_steps": 4}
    start, target = surfaces.start_surface("left", config["starts"]["near"]), surfaces.target_surface("left")
    few = config | {"n_watched_points": 500}
    fit, seconds = fitting.fit_leg("leg", leg, start, target, few, tmp_path)
    assert len(fit.history["assd"]) == 4
    assert fit.history["checked_crossings"] == [0, 0, 0, 0]
    assert fit.history["loss"][-1] < 0.7 * fit.history["loss"][0]
    again, same = fitting.fit_leg("leg", leg, start, target, few, tmp_path)
    assert same == seconds
    assert torch.equal(again.mesh.vertices, fit.mesh.vertices)
    mending = {"crossings": {"fitted": 0}, "n_faces": len(start.faces), "seconds": {"cpu": 1.0, "wall": 2.0}}
    told = part("run").fit_record(leg, fit, seconds, mending)
    assert told["loss"] == pytest.approx([np.mean(fit.history["loss"])])
    assert told["cpu_seconds_in_all"] == seconds["cpu"] + 1.0


def test_a_leg_that_makes_faces_cross_is_mended(part):
    sphere = icosphere(3, 10.0)
    field = grid_around(sphere.vertices, margin=4.0, spacings=(2.0,), n_pieces=1)
    with torch.no_grad():
        field.levels[0].normal_(0, 1.0, generator=torch.Generator().manual_seed(0))
        field.levels[0][..., : field.levels[0].shape[3] // 2, :] = 0
        field.levels[0][:, 6:10, 6:10] *= 20
    leg = {"longest_edge": 3.0, "standstill": 3.0}
    legs, start, told = part("fitting").mended_chain(leg, [Leg(field, 4)], sphere)
    assert told["crossings"]["fitted"] > 0
    assert told["crossings"]["damped"] == 0
    end = part("surfaces").carried(legs, start)
    assert len(self_intersecting_faces(end)) == 0
    assert told["n_faces"] == len(end.faces) > len(sphere.faces)
    lower = sphere.vertices[:, 2] < -8
    assert torch.equal(end.vertices[: len(lower)][lower], sphere.vertices[lower])
    # Faces that an earlier leg makes cross are a matter of that leg.
    back, front = part("fitting").stilled_chain([Leg(field, 4), Leg(field, 1)], sphere, 3.0)
    assert back.field is not field
    assert len(self_intersecting_faces(part("surfaces").carried([back], sphere))) == 0
    assert len(self_intersecting_faces(part("surfaces").carried([back, front], sphere))) == 0
    kept = part("fitting").mended_chain({}, [Leg(field, 4)], sphere)
    assert kept[0][0].field is field
    assert kept[1] is sphere
    assert list(kept[2]["crossings"]) == ["fitted"]


def test_stored_flows_lead_where_they_say(part, record, config):
    stored, surfaces, fitting = part("stored"), part("surfaces"), part("fitting")
    for side, tasks in config["kept"].items():
        target = surfaces.target_surface(side)
        for task in tasks:
            start, legs = stored.stored_flow(side, task)
            told = record["results"][side][task]
            with torch.no_grad():
                positions = chain_trajectory(legs, start.vertices)
            assert len(positions) == len(told["path"]["crossings"])
            end = start.with_vertices(positions[-1])
            assert len(self_intersecting_faces(end)) == told["stored"]["intersecting_faces"]
            assert told["stored"]["assd"] == pytest.approx(told["assd"], rel=0.02)
            assert fitting.closeness(end, target, config["n_points"], 0) == pytest.approx(told["stored"]["assd"])
            before = told["before"]["metrics"]["assd"]["value"]
            assert fitting.closeness(start, target, config["n_points"], 0) == pytest.approx(before)


def test_flows_that_were_not_kept_are_refused(part):
    refuses("no flow was kept for 'mixture' on the right", part("stored").stored_flow, "right", "mixture")
