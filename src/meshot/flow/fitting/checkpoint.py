"""The state of a fit, on disk as one safetensors file: tensors, and a JSON header for the rest."""

import json
import math
import os

import safetensors.torch
import torch

from meshot.files import whole_file
from meshot.flow.fields.field import LearnedVelocity
from meshot.stored_state import read_tensors, stored_parts
from meshot.types import Tensor

HISTORY = (
    "iteration",
    "loss",
    "n_directions",
    "checked_iteration",
    "checked_loss",
    "checked_crossings",
    "retreat_iteration",
)

#: What else the header holds, by the name in the state.
_NUMBERS = {"iteration": int, "best_iteration": int, "n_steps": int, "best_n_steps": int, "history": dict}


class FitState:
    """Where a fit stands: the field, its optimiser, how far it came, and the best so far."""

    def __init__(self, field: LearnedVelocity, optimiser: torch.optim.Adam, n_steps: int):
        self.field, self.optimiser = field, optimiser
        self.iteration, self.best_iteration, self.best_loss = 0, 0, math.inf
        self.n_steps, self.rate_factor = n_steps, 1.0  # what a guard may change on the way
        self.best: dict[str, Tensor] = {}
        self.history: dict[str, list[float]] = {name: [] for name in HISTORY}
        self.keep_as_best(math.inf)

    def keep_as_best(self, loss: float) -> None:
        """Remember the field as it is now."""
        self.best = {name: value.detach().clone() for name, value in self.field.state_dict().items()}
        self.best_iteration, self.best_loss, self.best_n_steps = self.iteration, loss, self.n_steps

    def restore_best(self) -> None:
        """Put the field and the number of steps back to the best state."""
        self.field.load_state_dict(self.best)
        self.n_steps = self.best_n_steps


def write_state(path: str | os.PathLike, state: FitState, settings: dict) -> None:
    """Write the state of a fit, whole or not at all."""
    tensors = {f"field/{name}": value.detach() for name, value in state.field.state_dict().items()}
    tensors |= {f"best/{name}": value for name, value in state.best.items()}
    for index, moments in state.optimiser.state_dict()["state"].items():
        tensors |= {f"adam/{index}/{name}": value for name, value in moments.items()}
    header = {
        "settings": json.loads(json.dumps(settings)),
        "iteration": state.iteration,
        "best_iteration": state.best_iteration,
        "best_loss": state.best_loss.hex(),
        "n_steps": state.n_steps,
        "best_n_steps": state.best_n_steps,
        "rate_factor": state.rate_factor.hex(),
        "kind": str(state.field),
        "history": state.history,
    }
    with whole_file(path) as temporary:
        contiguous = {name: value.contiguous() for name, value in tensors.items()}
        safetensors.torch.save_file(contiguous, temporary, metadata={"fit": json.dumps(header)})


def read_state(path: str | os.PathLike, state: FitState, settings: dict) -> None:
    """Read into ``state`` what :func:`write_state` wrote.

    Raises
    ------
    ValueError
        If the file is not such a checkpoint, or was made with other settings or another kind of field.
    """
    header, tensors = _read(path)
    now = json.loads(json.dumps(settings))
    changed = sorted(k for k in now.keys() | header["settings"] if header["settings"].get(k) != now.get(k))
    if changed:
        raise ValueError(
            f"the checkpoint {path} was made with other settings ({', '.join(changed)}): use those, or remove the file"
        )
    try:
        if header["kind"] != str(state.field):
            raise ValueError(f"it holds a {header['kind']}")
        own, best, moments = stored_parts(tensors, "field", state.field, state.optimiser)
        for name, kind in _NUMBERS.items():
            if type(header[name]) is not kind:
                raise ValueError(f"its {name} is {header[name]!r}")
        losses = float.fromhex(header["best_loss"]), float.fromhex(header["rate_factor"])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"the checkpoint {path} holds a field of another kind or size ({error}): remove the file to start anew"
        ) from error
    state.field.load_state_dict(own)
    state.optimiser.load_state_dict({"state": moments, "param_groups": state.optimiser.state_dict()["param_groups"]})
    state.best, (state.best_loss, state.rate_factor) = best, losses
    for name in _NUMBERS:
        setattr(state, name, header[name])


def _read(path: str | os.PathLike) -> tuple[dict, dict[str, Tensor]]:
    try:
        return read_tensors(path, "fit", "settings")
    except ValueError as error:
        raise ValueError(
            f"{path} is not a whole checkpoint of a fit ({error}): remove the file to start anew"
        ) from error
