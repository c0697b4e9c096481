"""The systems of this package: the same but for their loss, and at home in the registry and on the command line."""

import inspect

import pytest
import torch

from bright_head import shifting_network
from meshot.anatomy import HEMISPHERES
from meshot.model.deformation import DeformationNetwork
from meshot.systems import Part, Scan, get_system, read_settings, system_names
from meshot.systems.flows import DeformationSystem
from phantoms import phantom_subjects
from refusals import refuses

OURS = [name for name in system_names() if issubclass(get_system(name), DeformationSystem)]


@pytest.mark.parametrize("config", ["tiny", "small"])
def test_they_differ_in_their_loss_alone(config):
    found = {name: read_settings(get_system(name), config).as_dict() for name in OURS}
    assert len(found) == 3
    first, *others = found.values()
    for settings in others:
        assert settings["loss"] != first["loss"]
        assert settings | {"loss": None} == first | {"loss": None}


def test_the_paper_is_the_papers():
    paper = read_settings(get_system("ddot"), "paper").as_dict()
    assert (paper["loss"]["n_directions"], paper["training"]["n_epochs"]) == (100, 300)
    assert paper["training"]["learning_rate"] == 1e-4
    assert get_system("ddot").complete({}).loss.encoding.normal_scale == 1.0  # oriented, whatever an encoding's default
    assert read_settings(get_system("cortexode"), "paper").loss.settings() == {
        "loss": "chamfer", "encoding": "samples", "n_supports": None, "detach_weights": True, "factor": 1000.0,
    }  # fmt: skip


def test_a_setting_that_the_loss_does_not_use_is_refused_by_file_and_name():
    with pytest.raises(ValueError, match="small: the configuration of cortexode is invalid: normal_scale is set, whi"):
        read_settings(get_system("cortexode"), "small", ["loss.normal_scale=1.0"])
    changed = read_settings(get_system("ddot"), "small", ["loss.encoding=samples", "loss.normal_scale=null"]).as_dict()
    assert (changed["loss"]["loss"], changed["loss"]["encoding"]) == ("sliced", "samples")
    # What is the system's own, and not of a file, falls away with the encoding that used it.
    assert "normal_scale" not in get_system("ddot").complete({"loss": {"encoding": "samples"}}).loss.settings()


def test_the_loss_of_a_system_may_be_a_sum(monkeypatch):
    terms = [{"loss": "chamfer", "encoding": "samples"}, {"loss": "windowed", "encoding": "varifold"}]
    kind = get_system("cortexode")
    given = kind.complete({"loss": {"terms": terms}}).loss.settings()
    assert [term["loss"] for term in given["terms"]] == ["chamfer", "windowed"]
    assert given["terms"][0]["factor"] == 1.0  # not the thousand of CortexODE
    monkeypatch.setattr(kind, "loss", {"terms": terms})
    assert kind.complete({}).loss.settings() == given
    assert kind.complete({"loss": {"loss": "chamfer"}}).loss.settings()["loss"] == "chamfer"


@pytest.mark.parametrize("name", OURS)
def test_each_side_is_carried_by_its_own_flow_as_it_was_learned(name, monkeypatch):
    kind = get_system(name)
    (one,) = phantom_subjects(1, kind.needs)
    shifts = {"left": (0.0, 0.0, 1.0), "right": (0.5, 0.0, 0.0)}
    record = {"training": {"n_flow_steps": 3, "method": "rk4"}}
    system = kind({f"{side}_white": Part(shifting_network(shift), record) for side, shift in shifts.items()})
    seen = []
    names = inspect.unwrap(kind.find_surfaces).__globals__
    real = names["deformed"]
    monkeypatch.setitem(names, "deformed", lambda *a: seen.append(a[3:]) or real(*a))
    found = system.reconstruct(one.scan)
    assert seen == [(3, "rk4")] * 2
    for side in HEMISPHERES:
        moved = found[side, "white"].vertices - one.scan.initial[side, "white"].vertices
        torch.testing.assert_close(moved, torch.tensor(shifts[side]).expand_as(moved), atol=1e-4, rtol=0)
    left = kind({"left_white": Part(DeformationNetwork(2, (3,), 1, 3))})
    refuses(f"{name} has no trained right_white, only left_white: train what is missing", left.reconstruct, one.scan)
    with pytest.raises(ValueError, match=f"the scan has no initial surface right white; {name} starts from it"):
        system.reconstruct(Scan(one.scan.image, {("left", "white"): one.scan.initial["left", "white"]}))
