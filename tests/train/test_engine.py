"""The one engine: best and last weights, averaged weights, and a training that goes on as if it had never stopped."""

import dataclasses
import math

import pytest
import torch

from meshot.train import engine
from meshot.train.engine import Plan, Task, read_log, train, train_network
from meshot.train.state import TrainingState
from refusals import refuses

PLAN = Plan(12, 3, 4, None, 0.1, "constant")


class Kill(Exception):
    """A process that ends in the middle."""


def line(start: float = 0.0) -> torch.nn.Linear:
    network = torch.nn.Linear(1, 1, bias=False).double()
    torch.nn.init.constant_(network.weight, start)
    return network


def task_of(network: torch.nn.Module, validations: list[float] | None = None, aim: float = 1.0) -> Task:
    """The weight moves towards ``aim``; the validation says what it is told to, or the weight's distance."""

    def validate(step: int) -> dict:
        seen = float(network.weight.detach())
        return {"validation_loss": abs(seen - aim) if validations is None else validations[step // 3 - 1], "seen": seen}

    return Task(lambda _: ((network.weight - aim).square().sum(), "one weight"), validate)


def test_best_and_last_weights_are_kept():
    network = line()
    found = train_network(network, PLAN, task_of(network, [3.0, 1.0, 2.0, 4.0]), {})
    seen = {row["step"]: row["seen"] for row in found.log if "seen" in row}
    assert found.best_step == 6
    assert float(found.network.weight.detach()) == seen[6]
    assert float(found.last["weight"]) == seen[12] != seen[6]
    assert found.results()["n_steps"] == 12


def test_a_refused_validation_is_never_the_best():
    network = line()
    found = train_network(network, PLAN, task_of(network, [None, 5.0, None, None]), {})
    assert found.best_step == 6
    patient = dataclasses.replace(PLAN, patience=2, n_steps=30)
    again = line()
    assert train_network(again, patient, task_of(again, [1.0, None, None, 0.0]), {}).log[-1]["step"] == 9


def test_averaged_weights_are_those_of_the_definition():
    network, plan = line(), dataclasses.replace(PLAN, averaging=0.75)
    found = train_network(network, plan, task_of(network), {})
    plain = line()
    weights, average, wanted = [], None, []
    every = dataclasses.replace(PLAN, validate_every=1)
    train_network(plain, every, Task(task_of(plain).loss_of, lambda _: weights.append(float(plain.weight.detach())) or {
        "validation_loss": 0.0}), {})  # fmt: skip
    for weight in weights:
        average = weight if average is None else 0.75 * average + 0.25 * weight
        wanted.append(average)
    assert [row["seen"] for row in found.log if "seen" in row] == pytest.approx(wanted[2::3], rel=1e-12)
    assert float(found.last["weight"]) == weights[-1]  # the average changes nothing of the training
    assert float(found.network.weight.detach()) == pytest.approx(wanted[found.best_step - 1], rel=1e-12)


@pytest.mark.parametrize("averaging", [0.0, 0.75])
def test_the_last_weights_are_those_of_the_last_validation(tmp_path, averaging):
    network, plan = line(), dataclasses.replace(PLAN, averaging=averaging)
    found = train_network(network, plan, task_of(network, [1.0, 2.0, 3.0, 4.0]), {}, tmp_path)
    seen = {row["step"]: row["seen"] for row in found.log if "seen" in row}
    last = TrainingState.read_last_weights(tmp_path)
    assert last.keys() == {"weight"}
    assert float(last["weight"]) == seen[12] != seen[found.best_step]
    assert (float(last["weight"]) == float(found.last["weight"])) == (averaging == 0)
    (tmp_path / engine.STATE).write_bytes(b"torn")
    refuses("is not a whole state of a training", TrainingState.read_last_weights, tmp_path)


@pytest.mark.parametrize("averaging", [0.0, 0.9])
@pytest.mark.parametrize("stop", [2, 5, 9])
def test_a_stopped_training_goes_on_to_the_bit(tmp_path, averaging, stop):
    plan = dataclasses.replace(PLAN, averaging=averaging, schedule="cosine")
    whole_network, network, resumed_network = line(), line(), line()
    whole = train_network(whole_network, plan, task_of(whole_network), {})

    def die(done: int, n_steps: int, row: dict) -> None:
        if done == stop:
            raise Kill

    with pytest.raises(Kill):
        train_network(network, plan, task_of(network), {}, tmp_path, die)
    resumed = train_network(resumed_network, plan, task_of(resumed_network), {}, tmp_path)
    assert torch.equal(resumed.network.weight, whole.network.weight)
    assert torch.equal(resumed.last["weight"], whole.last["weight"])
    without = [[{k: v for k, v in row.items() if k != "cpu_seconds"} for row in run.log] for run in (resumed, whole)]
    assert without[0] == without[1]
    assert read_log(tmp_path / engine.LOG) == resumed.log


def test_another_training_another_network_and_a_torn_file_are_refused(tmp_path):
    network = line()
    train_network(network, PLAN, task_of(network), {"loss": 1, "data": {}}, tmp_path)
    with pytest.raises(ValueError, match="was made with another loss: use the same, or another folder"):
        train_network(network, PLAN, task_of(network), {"loss": 2, "data": {}}, tmp_path)
    wide = torch.nn.Linear(2, 1, bias=False).double()
    with pytest.raises(ValueError, match=r"is the state of another training \(its network is Linear.*remove it to"):
        train_network(wide, PLAN, task_of(wide), {"loss": 1, "data": {}}, tmp_path)
    state = tmp_path / engine.STATE
    state.write_bytes(state.read_bytes()[:-20])
    with pytest.raises(ValueError, match="is not a whole state of a training"):
        train_network(network, PLAN, task_of(network), {"loss": 1, "data": {}}, tmp_path)


def test_a_log_is_read_up_to_where_it_was_cut_short(tmp_path):
    (tmp_path / "log.jsonl").write_text('{"step": 1}\n{"step": 2}\n{"st')
    assert read_log(tmp_path / "log.jsonl") == [{"step": 1}, {"step": 2}]
    refuses("does not exist", read_log, tmp_path / "none.jsonl")


@pytest.mark.parametrize("line", ['{"step"\n{"step": 2}', "3", "[]", "[" * 100_000, "1" * 5000, "\udcff"])
def test_a_line_of_a_log_that_holds_no_names(tmp_path, line):
    (tmp_path / "log.jsonl").write_bytes((line + "\n").encode("utf-8", "surrogateescape"))
    refuses("is no log of a training", read_log, tmp_path / "log.jsonl")


def test_what_is_not_finite_is_named():
    network = line()
    with pytest.raises(FloatingPointError, match=r"the loss of step 0 \(a scan\) is not finite"):
        train_network(network, PLAN, Task(lambda _: (network.weight.sum() * math.nan, "a scan"), lambda _: {}), {})
    steep = Task(lambda _: (network.weight.abs().sqrt().sum(), "a scan"), lambda _: {})
    with pytest.raises(FloatingPointError, match=r"the gradient in weight of step 0 \(a scan\) is not finite"):
        train_network(network, PLAN, steep, {})


def test_a_task_may_hold_weights_back_and_give_up():
    network = line()
    task = task_of(network)
    held = dataclasses.replace(task, change_gradients=lambda step: setattr(network.weight, "grad", None))
    state = TrainingState(network, 0.1)
    train(state, PLAN, dataclasses.replace(held, is_given_up=lambda: state.step >= 5), {})
    assert (state.step, float(network.weight.detach())) == (5, 0.0)
