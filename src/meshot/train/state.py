"""The state of a training: network, optimiser, progress, best weights; and its storage as safetensors."""

import contextlib
import json
import math
import os
from collections.abc import Iterator

import safetensors
import safetensors.torch
import torch
from torch import nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from meshot.files import whole_file
from meshot.types import Tensor

#: The name of the file of a state.
STATE = "training.safetensors"


class TrainingState:
    """The state of a training.

    Parameters
    ----------
    network : module
    learning_rate : float
        Initial learning rate of Adam.
    averaging : float
        See :class:`meshot.train.Plan`.
    extras : dict, optional
        Additional JSON values that belong to the state and are stored with the best weights.

    Attributes
    ----------
    step, best_step : int
        Number of steps done, and number of steps before the best validation.
    rate_factor : float
        Factor on the planned learning rate. It may be lowered during the training.
    lines : list of dict
        The log.
    """

    def __init__(self, network: nn.Module, learning_rate: float, averaging: float = 0.0, extras: dict | None = None):
        self.network, self.optimiser = network, torch.optim.Adam(network.parameters(), lr=learning_rate)
        self.average = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(averaging)) if averaging else None
        self.step, self.best_step, self.best_loss = 0, 0, math.inf
        self.seconds, self.rate_factor = 0.0, 1.0
        self.extras = dict(extras or {})
        self.lines: list[dict] = []
        self.keep_as_best(math.inf)

    def keep_as_best(self, loss: float) -> None:
        """Store a copy of the current network as the best state."""
        self.best, self.best_extras = _copied(self.network), dict(self.extras)
        self.best_step, self.best_loss = self.step, loss

    def restore_best(self) -> None:
        """Restore weights and extras of the best state. Moments and learning rate do not change."""
        self.network.load_state_dict(self.best)
        self.extras = dict(self.best_extras)

    @staticmethod
    def read_last_weights(folder: str | os.PathLike) -> dict[str, Tensor]:
        """The weights after the last step of a training in its folder: the averaged ones, if it averages weights.

        Raises
        ------
        ValueError
            If the folder does not hold the state of a training.
        """
        _, tensors = _read(os.path.join(folder, STATE))
        averaged = "average/module."
        prefix = averaged if any(name.startswith(averaged) for name in tensors) else "network/"
        return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}

    @contextlib.contextmanager
    def averaged(self) -> Iterator[None]:
        """Use the averaged weights, if any, in the network within the block."""
        if self.average is None:
            yield
            return
        own = _copied(self.network)
        self.network.load_state_dict(self.average.module.state_dict())
        yield
        self.network.load_state_dict(own)


def _copied(network: nn.Module) -> dict[str, Tensor]:
    return {name: value.detach().clone() for name, value in network.state_dict().items()}


def write_training(path: str | os.PathLike, state: TrainingState, made_with: dict) -> None:
    """Write the state of a training, completely or not at all."""
    tensors = {f"network/{name}": value for name, value in state.network.state_dict().items()}
    tensors |= {f"best/{name}": value for name, value in state.best.items()}
    for index, moments in state.optimiser.state_dict()["state"].items():
        tensors |= {f"adam/{index}/{name}": value for name, value in moments.items()}
    if state.average is not None:
        tensors |= {f"average/{name}": value for name, value in state.average.state_dict().items()}
    header = {name: getattr(state, name) for name in ("step", "best_step", "seconds", "lines", "extras", "best_extras")}
    header |= {name: getattr(state, name).hex() for name in ("best_loss", "rate_factor")}
    header |= {"made_with": made_with, "kind": str(state.network)}
    with whole_file(path) as temporary:
        plain = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
        safetensors.torch.save_file(plain, temporary, metadata={"training": json.dumps(header)})


def read_training(path: str | os.PathLike, state: TrainingState, made_with: dict) -> None:
    """Read a state written by :func:`meshot.train.state.write_training` into ``state``."""
    header, tensors = _read(path)
    now = json.loads(json.dumps(made_with))
    changed = sorted(k for k in now.keys() | header["made_with"] if header["made_with"].get(k) != now.get(k))
    if changed:
        raise ValueError(
            f"the training in {path} was made with another {' and '.join(changed)}: use the same, or another folder"
        )
    average = {name: tensors.pop(name) for name in list(tensors) if name.startswith("average/")}
    try:
        if header["kind"] != str(state.network):
            raise ValueError(f"its network is {header['kind']}")
        own, best, moments = stored_parts(tensors, state.network, state.optimiser)
        found = {name: header[name] for name in ("step", "best_step", "seconds", "lines", "extras", "best_extras")}
        step, best_step, seconds = (header[name] for name in ("step", "best_step", "seconds"))
        if type(step) is not int or type(best_step) is not int or not 0 <= best_step <= step:
            raise ValueError(f"it is at step {step!r}, its best at {best_step!r}")
        if not isinstance(seconds, int | float) or not 0 <= seconds < math.inf:
            raise ValueError(f"it took {seconds!r} seconds")
        if not isinstance(header["lines"], list) or not all(isinstance(line, dict) for line in header["lines"]):
            raise ValueError("its log is no list of entries")
        kinds = {name: type(value) for name, value in state.extras.items()}
        for one in (header["extras"], header["best_extras"]):
            if not isinstance(one, dict) or {name: type(value) for name, value in one.items()} != kinds:
                raise ValueError(f"its extras are {one!r}")
        found |= {name: float.fromhex(header[name]) for name in ("best_loss", "rate_factor")}
        if state.average is not None:
            state.average.load_state_dict({name.removeprefix("average/"): value for name, value in average.items()})
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{path} is the state of another training ({error}): remove it to start anew") from error
    state.network.load_state_dict(own)
    state.optimiser.load_state_dict({"state": moments, "param_groups": state.optimiser.state_dict()["param_groups"]})
    state.best = best
    for name, value in found.items():
        setattr(state, name, value)


def _read(path: str | os.PathLike) -> tuple[dict, dict[str, Tensor]]:
    try:
        return read_tensors(path, "training", "made_with")
    except ValueError as error:
        raise ValueError(f"{path} is not a whole state of a training ({error}): remove it to start anew") from error


# Reading of the state of a training from a safetensors file, with checks before anything is changed.

#: The tensors that Adam stores for every parameter. All but the step have the shape of the parameter.
_MOMENTS = {"step", "exp_avg", "exp_avg_sq"}


def read_tensors(path: str | os.PathLike, name: str, entry: str) -> tuple[dict, dict[str, Tensor]]:
    """The JSON header ``name`` of a safetensors file, in which ``entry`` is a mapping, and its tensors."""
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})[name])
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
        if not isinstance(header, dict) or not isinstance(header[entry], dict):
            raise ValueError(f"its header holds no {entry}")
    except (OSError, safetensors.SafetensorError, KeyError, ValueError, RecursionError) as error:
        raise ValueError(str(error)) from error
    return header, tensors


def stored_parts(
    tensors: dict[str, Tensor], module: nn.Module, optimiser: torch.optim.Adam
) -> tuple[dict[str, Tensor], dict[str, Tensor], dict[int, dict[str, Tensor]]]:
    """The weights of a module, the best weights, and the moments of the optimiser by index of the parameter."""
    parts: dict[str, dict[str, Tensor]] = {part: {} for part in ("network", "best", "adam")}
    for name, value in tensors.items():
        part, _, key = name.partition("/")
        if part not in parts:
            raise ValueError(f"{name} is unknown")
        parts[part][key] = value
    for part in ("network", "best"):
        if _forms(parts[part]) != _forms(module.state_dict()):
            raise ValueError(f"{part} has other tensors")
    parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
    found: dict[int, dict[str, Tensor]] = {}
    for key, value in parts["adam"].items():
        index, _, name = key.partition("/")
        if not index.isdecimal() or int(index) >= len(parameters) or name not in _MOMENTS:
            raise ValueError(f"adam/{key} is unknown")
        if value.shape != (() if name == "step" else parameters[int(index)].shape):
            raise ValueError(f"adam/{key} has the shape {tuple(value.shape)}")
        found.setdefault(int(index), {})[name] = value
    if any(set(moments) != _MOMENTS for moments in found.values()):
        raise ValueError("moments of the optimiser are missing")
    return parts["network"], parts["best"], found


def _forms(tensors: dict[str, Tensor]) -> dict[str, tuple]:
    return {name: (tuple(value.shape), value.dtype) for name, value in tensors.items()}
