"""The training loop: steps, validations, a state on disk, and a log. A stopped training can be resumed."""

import dataclasses
import os
import time
from collections.abc import Callable
from pathlib import Path

import torch
from torch import nn

from meshot.train.log import TrainingLog
from meshot.train.plan import Plan
from meshot.train.state import STATE, TrainingState, read_training, write_training
from meshot.types import Tensor

LOG = "log.jsonl"

#: Called with (steps done, number of steps, line of the log).
Progress = Callable[[int, int, dict], None]


@dataclasses.dataclass(frozen=True, eq=False)
class Training:
    """A trained network, and the history of its training.

    Parameters
    ----------
    network : module
        In its best state: at the validation with the lowest loss.
    last : dict
        The weights after the last step.
    best_step : int
        Number of steps before that validation.
    log : list of dict
        For every step ``step``, ``loss`` and ``learning_rate``; for every validation ``step``, ``validation_loss``,
        ``cpu_seconds`` and other metrics.
    cpu_seconds : float
        Processor time of this process and of the stopped processes before it.
    data : dict
        The number of examples for training and validation, and the SHA-256 of each set.
    """

    network: nn.Module
    last: dict[str, Tensor]
    best_step: int
    log: list[dict]
    cpu_seconds: float
    data: dict

    def results(self) -> dict:
        """The part of the training that is stored in its record, as JSON values."""
        return {
            "best_step": self.best_step,
            "n_steps": max(line["step"] for line in self.log),
            "cpu_seconds": round(self.cpu_seconds, 1),
            "n_weights": sum(parameter.numel() for parameter in self.network.parameters()),
            "validations": [line for line in self.log if "validation_loss" in line],
            "data": self.data,
        }


@dataclasses.dataclass(frozen=True, eq=False)
class Task:
    """The functions that define a training.

    Parameters
    ----------
    loss_of : callable of step
        Returns the loss of a step, and the names of the examples it was computed from.
    validate : callable of step
        Returns a line of the log with ``validation_loss``. If that is None, the state is not considered as the best.
    change_gradients : callable of step, optional
        Called between the computation of the gradients and the step of the optimiser.
    is_given_up : callable, optional
        Whether the training ends before the planned number of steps.
    """

    loss_of: Callable[[int], tuple[Tensor, str]]
    validate: Callable[[int], dict]
    change_gradients: Callable[[int], None] = lambda _: None
    is_given_up: Callable[[], bool] = lambda: False


def chosen_device() -> torch.device:
    """The GPU if there is one, else the CPU."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def train_network(
    network: nn.Module,
    plan: Plan,
    task: Task,
    made_with: dict,
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
) -> Training:
    """Train a network with Adam, or resume the training in ``folder``, until the plan is completed.

    Parameters
    ----------
    network : module
        Modified in place. At the end it is in its best state, on the CPU.
    plan : Plan
    task : Task
    made_with : dict
        The settings, and a description of the data under ``data``. A training resumes only if they are the same.
    folder : path, optional
        The folder for the state (``training.safetensors``) and the log (``log.jsonl``).
    progress : callable, optional

    Raises
    ------
    ValueError
        If the folder contains a different training.
    FloatingPointError
        If the loss or a gradient is not finite. The message names the step, and the examples of the loss.
    """
    state = TrainingState(network, plan.learning_rate, plan.averaging)
    files = (None, None) if folder is None else (Path(folder) / STATE, Path(folder) / LOG)
    last = train(state, plan, task, made_with, *files, progress)
    return Training(network.cpu(), last, state.best_step, state.lines, state.seconds, made_with.get("data", {}))


def train(
    state: TrainingState,
    plan: Plan,
    task: Task,
    made_with: dict,
    saved: str | os.PathLike | None = None,
    log: str | os.PathLike | None = None,
    progress: Progress | None = None,
) -> dict[str, Tensor]:
    """Continue from ``state``, or from the saved state, until the plan is completed. ``state`` is then the best one.

    Parameters
    ----------
    state : TrainingState
    plan : Plan
    task : Task
    made_with : dict
        See :func:`meshot.train.train_network`.
    saved, log : path, optional
        The files for the state and for the lines of the log.
    progress : callable, optional
        Called for each line, after the state has been saved.

    Returns
    -------
    dict
        The last weights.

    Raises
    ------
    ValueError, FloatingPointError
        As :func:`meshot.train.train_network`.
    """
    if saved is not None and os.path.exists(saved):
        read_training(saved, state, made_with)
    file, clock = TrainingLog(None if log is None else Path(log), state.lines), time.process_time()
    while not _is_done(state, plan, task):
        made = [_step(state, plan, task)]
        if state.step % plan.validate_every == 0 or state.step == plan.n_steps:
            found = _validated(state, task)
            state.seconds, clock = state.seconds + time.process_time() - clock, time.process_time()
            made.append({"step": state.step} | found | {"cpu_seconds": round(state.seconds, 1)})
        state.lines.extend(made)
        for line in made:
            file.add(line)
        if saved is not None and (state.step % plan.save_every == 0 or _is_done(state, plan, task)):
            state.seconds, clock = state.seconds + time.process_time() - clock, time.process_time()
            write_training(saved, state, made_with)
        for line in made if progress is not None else ():
            progress(state.step, plan.n_steps, line)
    last = {name: value.detach().cpu().clone() for name, value in state.network.state_dict().items()}
    state.restore_best()
    return last


def _is_done(state: TrainingState, plan: Plan, task: Task) -> bool:
    fruitless = sum("validation_loss" in line and line["step"] > state.best_step for line in state.lines)
    out_of_patience = plan.patience is not None and fruitless >= plan.patience
    return state.step >= plan.n_steps or out_of_patience or task.is_given_up()


def _validated(state: TrainingState, task: Task) -> dict:
    with state.averaged():
        found = task.validate(state.step)
        if found["validation_loss"] is not None and found["validation_loss"] < state.best_loss:
            state.keep_as_best(found["validation_loss"])
    return found


def _step(state: TrainingState, plan: Plan, task: Task) -> dict:
    state.optimiser.zero_grad(set_to_none=True)
    loss, names = task.loss_of(state.step)
    _require_finite(loss.detach(), f"the loss of step {state.step} ({names})")
    loss.backward()
    for name, parameter in state.network.named_parameters():
        if parameter.grad is not None:
            _require_finite(parameter.grad, f"the gradient in {name} of step {state.step} ({names})")
    task.change_gradients(state.step)
    rate = plan.learning_rate_at(state.step) * state.rate_factor
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    state.optimiser.step()
    if state.average is not None:
        state.average.update_parameters(state.network)
    state.step += 1
    return {"step": state.step, "loss": float(loss.detach()), "learning_rate": rate}


def _require_finite(values: Tensor, name: str) -> None:
    if not bool(torch.isfinite(values.sum())):
        raise FloatingPointError(
            f"{name} is not finite; lower the learning rate, or look at the meshes and scans that it came from. The "
            "last saved state is whole"
        )
