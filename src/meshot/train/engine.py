"""What every training shares: steps, validations in between, a state on disk, a log; stopped, it goes on."""

import dataclasses
import math
import os
import time
from collections.abc import Callable
from pathlib import Path

import torch
from torch import nn

from meshot.errors import require_positive_integer
from meshot.train.checkpoint import TrainingLog, TrainingState, read_training, write_training

STATE, LOG = "training.safetensors", "log.jsonl"
SCHEDULES = ("constant", "cosine")

#: Called with (steps done, steps in all, line of the log).
Progress = Callable[[int, int, dict], None]


@dataclasses.dataclass(frozen=True, eq=False)
class Training:
    """A trained network and how it came about.

    Parameters
    ----------
    network : module
        In its best state: that of the validation with the lowest loss.
    best_step : int
        Steps before that validation.
    log : list of dict
        ``step``, ``loss`` and ``learning_rate`` of every step; ``step``, ``validation_loss``, ``cpu_seconds`` and what
        else is measured of every validation.
    cpu_seconds : float
        Of this process and of those before it that were stopped.
    data : dict
        How many examples for training and validation, and the SHA-256 of each set.
    """

    network: nn.Module
    best_step: int
    log: list[dict]
    cpu_seconds: float
    data: dict


@dataclasses.dataclass(frozen=True)
class Plan:
    """How long a training goes on.

    Parameters
    ----------
    n_steps : int
    validate_every, save_every : int
        In steps.
    patience : int, optional
        Stop after so many validations in a row without a lower loss; None: never.
    learning_rate : float
    schedule : str
        "constant", or "cosine": half a cosine from there to zero.
    """

    n_steps: int
    validate_every: int
    save_every: int
    patience: int | None
    learning_rate: float
    schedule: str

    def learning_rate_at(self, step: int) -> float:
        """The learning rate of one step."""
        if self.schedule == "constant":
            return self.learning_rate
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * step / self.n_steps))


def require_plan_settings(settings: object) -> None:
    """Refuse numbers that no training can have: of epochs, of the learning rate, of patience, of the seed.

    Raises
    ------
    ValueError
        If one is outside its range.
    """
    for name in ("n_epochs", "batch_size", "validate_every", "save_every"):
        require_positive_integer(getattr(settings, name, 1), name)
    if settings.patience is not None:
        require_positive_integer(settings.patience, "patience")
    if not 0 < settings.learning_rate < math.inf:
        raise ValueError(f"learning_rate is {settings.learning_rate!r}; a finite number > 0 is needed")
    if isinstance(settings.seed, bool) or not isinstance(settings.seed, int) or settings.seed < 0:
        raise ValueError(f"seed is {settings.seed!r}; an integer >= 0 is needed")
    if settings.schedule not in SCHEDULES:
        raise ValueError(f"schedule is {settings.schedule!r}; one of {', '.join(SCHEDULES)} is needed")


def chosen_device() -> torch.device:
    """The accelerator if there is one, else the processor."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def train(
    state: TrainingState,
    plan: Plan,
    loss_of: Callable[[int], tuple[torch.Tensor, str]],
    validate: Callable[[], dict],
    made_with: dict,
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
) -> None:
    """Go on from ``state``, or from what ``folder`` holds, until the plan is fulfilled; the state then knows the best.

    Parameters
    ----------
    state : TrainingState
    plan : Plan
    loss_of : callable of step
        The loss of a step, and the name of what it was computed from.
    validate : callable
        A line of the log with ``validation_loss``. A ``ValueError`` of it is taken for the network's failure.
    made_with : dict
        Settings and data: a training goes on only with the same.
    folder : path, optional
        Where the state is saved (``training.safetensors``) and the log is kept (``log.jsonl``).
    progress : callable, optional

    Raises
    ------
    ValueError
        If the folder holds a training of something else.
    FloatingPointError
        If the loss or a gradient is not finite, or the validation fails; it names the step, and the examples of a loss.
    """
    saved = None if folder is None else Path(folder) / STATE
    if saved is not None and saved.exists():
        read_training(saved, state, made_with)
    log, clock = TrainingLog(None if folder is None else Path(folder) / LOG, state.lines), time.process_time()

    def note(line: dict) -> None:
        state.lines.append(line)
        log.add(line)
        if progress is not None:
            progress(state.step, plan.n_steps, line)

    while state.step < plan.n_steps and not _out_of_patience(state, plan):
        note(_step(state, plan, loss_of))
        if state.step % plan.validate_every == 0 or state.step == plan.n_steps:
            found = _validated(state, validate)
            if found["validation_loss"] < state.best_loss:
                state.keep_as_best(found["validation_loss"])
            state.seconds, clock = state.seconds + time.process_time() - clock, time.process_time()
            note({"step": state.step} | found | {"cpu_seconds": round(state.seconds, 1)})
        done = state.step == plan.n_steps or _out_of_patience(state, plan)
        if saved is not None and (done or state.step % plan.save_every == 0):
            state.seconds, clock = state.seconds + time.process_time() - clock, time.process_time()
            write_training(saved, state, made_with)
    state.network.load_state_dict(state.best)


def _validated(state: TrainingState, validate: Callable[[], dict]) -> dict:
    try:
        return validate()
    except ValueError as error:
        raise FloatingPointError(
            f"the validation after step {state.step} failed: {error}; lower the learning rate. The last saved state is "
            "whole"
        ) from error


def _out_of_patience(state: TrainingState, plan: Plan) -> bool:
    fruitless = sum("validation_loss" in line and line["step"] > state.best_step for line in state.lines)
    return plan.patience is not None and fruitless >= plan.patience


def _step(state: TrainingState, plan: Plan, loss_of: Callable[[int], tuple[torch.Tensor, str]]) -> dict:
    state.optimiser.zero_grad(set_to_none=True)
    loss, names = loss_of(state.step)
    loss.backward()
    total = sum(parameter.grad.square().sum() for parameter in state.network.parameters())
    for name, value in (("loss", loss), ("gradient", total)):
        if not bool(torch.isfinite(value)):
            raise FloatingPointError(
                f"the {name} of step {state.step} ({names}) is not finite; lower the learning rate, or look at those "
                "scans. The last saved state is whole"
            )
    rate = plan.learning_rate_at(state.step)
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    state.optimiser.step()
    state.step += 1
    return {"step": state.step, "loss": float(loss.detach()), "learning_rate": rate}
