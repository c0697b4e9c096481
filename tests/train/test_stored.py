"""States of an optimisation that belong to another network, or are damaged: refused before anything changes."""

import json

import pytest
import safetensors.torch
import torch
from torch import nn

from meshot.flow.fields import GridVelocity
from meshot.flow.fitting import FitState
from meshot.train.state import TrainingState, read_tensors, read_training, stored_parts, write_training
from refusals import refuses


def trained(n_inputs: int = 3) -> tuple[nn.Module, torch.optim.Adam]:
    network = nn.Linear(n_inputs, 2)
    optimiser = torch.optim.Adam(network.parameters())
    network(torch.ones(1, n_inputs)).sum().backward()
    optimiser.step()
    return network, optimiser


def tensors_of(network: nn.Module, optimiser: torch.optim.Adam) -> dict:
    found = {f"{part}/{k}": v for part in ("network", "best") for k, v in network.state_dict().items()}
    for index, moments in optimiser.state_dict()["state"].items():
        found |= {f"adam/{index}/{name}": value for name, value in moments.items()}
    return found


def test_parts_are_told_apart():
    network, optimiser = trained()
    own, best, moments = stored_parts(tensors_of(network, optimiser), network, optimiser)
    assert set(own) == set(best) == {"weight", "bias"}
    assert set(moments) == {0, 1}
    optimiser.load_state_dict({"state": moments, "param_groups": optimiser.state_dict()["param_groups"]})


def drop(name):
    return lambda tensors: tensors.pop(name)


def put(name, value):
    return lambda tensors: tensors.__setitem__(name, value)


DAMAGE = {
    "a weight of another shape": put("network/weight", torch.zeros(2, 5)),
    "a weight of another dtype": put("network/weight", torch.zeros(2, 3, dtype=torch.int64)),
    "a missing weight": drop("network/bias"),
    "a missing best": drop("best/bias"),
    "an unknown weight": put("network/other", torch.zeros(1)),
    "an unknown part": put("other/weight", torch.zeros(1)),
    "no part": put("weight", torch.zeros(1)),
    "a moment of another shape": put("adam/0/exp_avg", torch.zeros(1)),
    "a step that is a vector": put("adam/0/step", torch.zeros(3)),
    "a missing moment": drop("adam/1/exp_avg_sq"),
    "an unknown moment": put("adam/0/other", torch.zeros(2, 3)),
    "an unknown parameter": put("adam/7/exp_avg", torch.zeros(2, 3)),
    "an index that is no number": put("adam/x/exp_avg", torch.zeros(2, 3)),
    "no index": put("adam/exp_avg", torch.zeros(2, 3)),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_every_damage_is_seen(name):
    network, optimiser = trained()
    tensors = tensors_of(network, optimiser)
    DAMAGE[name](tensors)
    refuses(r"has other tensors|is unknown|has the shape|are missing", stored_parts, tensors, network, optimiser)


@pytest.mark.parametrize("header", ["[1]", "{", "{}", '{"made": 1}', "[" * 100_000, "null"])
def test_headers_that_are_none(tmp_path, header):
    safetensors.torch.save_file({"a": torch.zeros(1)}, tmp_path / "a.safetensors", metadata={"x": header})
    refuses(r".+", read_tensors, tmp_path / "a.safetensors", "x", "made")


def test_files_that_are_none(tmp_path):
    refuses(r".+", read_tensors, tmp_path / "missing", "x", "made")
    (tmp_path / "a").write_bytes(b"\xff" * 200)
    refuses(r".+", read_tensors, tmp_path / "a", "x", "made")


def fit_state() -> FitState:
    field = GridVelocity(torch.zeros(3), torch.ones(3), (0.5,), 1)
    return FitState(field, 1e-3, 4)


def training_state() -> TrainingState:
    return TrainingState(nn.Linear(2, 1), 1e-3)


@pytest.mark.parametrize(
    ("made", "entry", "value"),
    [
        (fit_state, "step", "x"),
        (fit_state, "extras", {"n_steps": None}),
        (fit_state, "best_extras", {}),
        (fit_state, "extras", []),
        (fit_state, "lines", {}),
        (fit_state, "best_loss", 3),
        (fit_state, "rate_factor", "z"),
        (fit_state, "kind", 1),
        (training_state, "step", "x"),
        (training_state, "step", -1),
        (training_state, "seconds", None),
        (training_state, "seconds", "long"),
        (training_state, "lines", 3),
        (training_state, "lines", [1]),
        (training_state, "best_loss", []),
        (training_state, "made_with", []),
    ],
)
def test_a_checkpoint_with_a_damaged_header_changes_nothing(tmp_path, made, entry, value):
    path, state = tmp_path / "state.safetensors", made()
    write_training(path, state, {"a": 1})
    read_training(path, made(), {"a": 1})
    with safetensors.safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["training"])
    tensors = {name: value + 1 for name, value in safetensors.torch.load_file(path).items()}
    safetensors.torch.save_file(tensors, path, metadata={"training": json.dumps(header | {entry: value})})
    refuses("remove it to start anew", read_training, path, state, {"a": 1})
    assert all(torch.equal(value + 1, tensors[f"network/{name}"]) for name, value in state.network.state_dict().items())
