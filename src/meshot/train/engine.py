"""The training loop: steps, validations, a state on disk, and a log. A stopped training can be resumed."""

import dataclasses
import json
import math
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
import torch
from torch import nn

from meshot.files import naming_a_full_disk, write_whole
from meshot.settings import Count, Natural, Positive, Settings, Within, one_of
from meshot.train.state import STATE, TrainingState, read_training, write_training
from meshot.types import Tensor

# The plan of a training: number of steps, learning rate, validation.

SCHEDULES = ("constant", "cosine")


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a training.

    Parameters
    ----------
    n_steps : int
    validate_every, save_every : int
        In steps.
    patience : int, optional
        Stop after this many consecutive validations without a lower loss. None: never.
    learning_rate : float
        The initial learning rate.
    schedule : str
        "constant", or "cosine": half a cosine to zero.
    averaging : float
        In [0, 1). If positive, the exponential moving average of the weights with this decay per step is validated and
        stored, instead of the weights themselves.
    """

    n_steps: int
    validate_every: int
    save_every: int
    patience: int | None
    learning_rate: float
    schedule: str
    averaging: float = 0.0

    def learning_rate_at(self, step: int) -> float:
        """The learning rate of one step."""
        if self.schedule == "constant":
            return self.learning_rate
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * step / self.n_steps))


@dataclasses.dataclass(frozen=True)
class TrainingSettings(Settings):
    """Settings that all trainings have.

    Parameters
    ----------
    n_epochs : int
        Number of passes over all training examples.
    learning_rate, schedule, averaging
        Of Adam: see :class:`meshot.train.Plan`.
    validate_every, patience : int
        In epochs. The training stops after ``patience`` consecutive validations without a lower loss (None: never).
    save_every : int
        In steps.
    seed : int
        Seed of all random numbers. Step i uses (seed, i), so that a resumed training draws the same numbers.
    """

    #: The number of examples in a step.
    batch_size: ClassVar[int] = 1

    n_epochs: Count = 100
    learning_rate: Positive = 1e-3
    schedule: Annotated[str, one_of(SCHEDULES)] = "cosine"
    validate_every: Count = 10
    patience: Count | None = None
    save_every: Count = 100
    averaging: Annotated[float, Within(0, 1, "[)")] = 0.0
    seed: Natural = 0

    def plan(self, n_examples: int) -> Plan:
        """The settings in steps instead of epochs, for a number of training examples."""
        per_epoch = -(-n_examples // self.batch_size)
        return Plan(
            self.n_epochs * per_epoch,
            self.validate_every * per_epoch,
            self.save_every,
            self.patience,
            self.learning_rate,
            self.schedule,
            self.averaging,
        )


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
    """
    if saved is not None and os.path.exists(saved):
        read_training(saved, state, made_with)
    file, clock = TrainingLog(None if log is None else Path(log), state.lines), time.process_time()
    while not _is_done(state, plan, task):
        made = [_step(state, plan, task)]
        if state.step % plan.validate_every == 0 or state.step == plan.n_steps:
            with state.averaged():
                found = task.validate(state.step)
                if found["validation_loss"] is not None and found["validation_loss"] < state.best_loss:
                    state.keep_as_best(found["validation_loss"])
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


# The log of a training: a file with one line of JSON per event.


class TrainingLog:
    """A file of JSON lines, one for each step and each validation.

    Parameters
    ----------
    path : path, optional
        With None, no file is written.
    lines : list of dict
        The lines of a resumed training. They replace the content of the file.
    """

    def __init__(self, path: Path | None, lines: list[dict]):
        self.path = path
        if path is not None:
            write_whole(path, "".join(json.dumps(line) + "\n" for line in lines))

    def add(self, line: dict) -> None:
        """Append a line to the file immediately."""
        if self.path is not None:
            with naming_a_full_disk(self.path), self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


def read_log(path: str | os.PathLike) -> list[dict]:
    """The lines of a log. An incomplete last line, left by a killed process, is omitted.

    Raises
    ------
    ValueError
        If the file is missing or an inner line is not JSON.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist; a training writes it as it goes")
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        lines = [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no log of a training ({error})") from error
    if not all(isinstance(line, dict) for line in lines):
        raise ValueError(f"{path} is no log of a training: a line holds no names and values")
    return lines


# Examples of a training: which ones a step uses, and their record.

_ORDER = 0  # random number stream; a training has the streams from 1


def require_examples(training: Sequence, validation: Sequence) -> None:
    """Check that there are examples for training and for validation.

    Raises
    ------
    ValueError
        If one of the two is empty.
    """
    if not training or not validation:
        raise ValueError(
            f"{len(training)} examples for training and {len(validation)} for validation came; at least one of each is "
            "needed"
        )


def examples_of_step(step: int, n_examples: int, seed: int, batch_size: int = 1) -> list[int]:
    """The indices of the training examples of a step. Every epoch visits all examples in a new random order.

    The last step of an epoch has fewer than ``batch_size`` examples if ``n_examples`` is not a multiple of it.
    """
    epoch, place = divmod(step, -(-n_examples // batch_size))
    order = np.random.default_rng([seed, _ORDER, epoch]).permutation(n_examples)
    return order[place * batch_size : (place + 1) * batch_size].tolist()


def data_record(training: Sequence, validation: Sequence, digest: Callable[[Sequence], str]) -> dict:
    """The number of examples for training and validation, and a digest of each set."""
    parts = (("training", training), ("validation", validation))
    return {name: {"n_scans": len(part), "sha256": digest(part)} for name, part in parts}
