"""The state of a training, on disk as one safetensors file, and its log, one line of JSON for each event."""

import json
import math
import os
from pathlib import Path

import safetensors.torch
import torch
from torch import nn

from meshot.files import whole_file
from meshot.stored_state import read_tensors, stored_parts
from meshot.types import Tensor


class TrainingState:
    """Where a training stands: the network, its optimiser, how far it came, and the best so far."""

    def __init__(self, network: nn.Module, optimiser: torch.optim.Adam):
        self.network, self.optimiser = network, optimiser
        self.step, self.best_step, self.best_loss = 0, 0, math.inf
        self.seconds = 0.0
        self.lines: list[dict] = []
        self.keep_as_best(math.inf)

    def keep_as_best(self, loss: float) -> None:
        """Remember the network as it is now."""
        self.best = {name: value.detach().clone() for name, value in self.network.state_dict().items()}
        self.best_step, self.best_loss = self.step, loss


def write_training(path: str | os.PathLike, state: TrainingState, made_with: dict) -> None:
    """Write the state of a training, whole or not at all.

    Parameters
    ----------
    path : path
    state : TrainingState
    made_with : dict
        Settings and data; a state is read only by who has the same.
    """
    tensors = {f"network/{name}": value for name, value in state.network.state_dict().items()}
    tensors |= {f"best/{name}": value for name, value in state.best.items()}
    for index, moments in state.optimiser.state_dict()["state"].items():
        tensors |= {f"adam/{index}/{name}": value for name, value in moments.items()}
    header = {
        "made_with": made_with,
        "step": state.step,
        "best_step": state.best_step,
        "best_loss": state.best_loss.hex(),
        "seconds": state.seconds,
        "lines": state.lines,
    }
    with whole_file(path) as temporary:
        plain = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
        safetensors.torch.save_file(plain, temporary, metadata={"training": json.dumps(header)})


def read_training(path: str | os.PathLike, state: TrainingState, made_with: dict) -> None:
    """Read into ``state`` what :func:`meshot.train.checkpoint.write_training` wrote.

    Raises
    ------
    ValueError
        If the file is not such a state, or was made with other settings or data.
    """
    header, tensors = _read(path)
    now = json.loads(json.dumps(made_with))
    changed = sorted(k for k in now.keys() | header["made_with"] if header["made_with"].get(k) != now.get(k))
    if changed:
        raise ValueError(
            f"the training in {path} was made with another {' and '.join(changed)}: use the same, or another folder"
        )
    try:
        own, best, moments = stored_parts(tensors, "network", state.network, state.optimiser)
        step, best_step, best_loss, seconds, lines = _progress(header)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is the state of another training ({error}): remove it to start anew") from error
    state.network.load_state_dict(own)
    state.optimiser.load_state_dict({"state": moments, "param_groups": state.optimiser.state_dict()["param_groups"]})
    state.best = best
    state.step, state.best_step, state.best_loss, state.seconds, state.lines = (
        step, best_step, best_loss, seconds, lines,
    )  # fmt: skip


def _progress(header: dict) -> tuple[int, int, float, float, list[dict]]:
    """Steps, best step, best loss, seconds and lines of the log."""
    step, best_step, seconds, lines = (header[name] for name in ("step", "best_step", "seconds", "lines"))
    if type(step) is not int or type(best_step) is not int or not 0 <= best_step <= step:
        raise ValueError(f"it is at step {step!r}, its best at {best_step!r}")
    if not isinstance(seconds, int | float) or not 0 <= seconds < math.inf:
        raise ValueError(f"it took {seconds!r} seconds")
    if not isinstance(lines, list) or not all(isinstance(line, dict) for line in lines):
        raise ValueError("its log is no list of entries")
    return step, best_step, float.fromhex(header["best_loss"]), seconds, lines


def _read(path: str | os.PathLike) -> tuple[dict, dict[str, Tensor]]:
    try:
        return read_tensors(path, "training", "made_with")
    except ValueError as error:
        raise ValueError(f"{path} is not a whole state of a training ({error}): remove it to start anew") from error


class TrainingLog:
    """A file of JSON lines that grows with the training, one for each step and each validation.

    Parameters
    ----------
    path : path, optional
        None keeps no file.
    lines : list of dict
        What is known already, of a training that goes on: the file then says just that, whatever a kill left in it.
    """

    def __init__(self, path: Path | None, lines: list[dict]):
        self.path = path
        if path is not None:
            with whole_file(path) as temporary:
                temporary.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")

    def add(self, line: dict) -> None:
        """One more line, at once on disk."""
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


def read_log(path: str | os.PathLike) -> list[dict]:
    """The lines of a log; a last one that a kill cut short is left out.

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
