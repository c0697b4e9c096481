"""The registry of systems: those in this folder, and those that other packages register as entry points."""

import importlib
import os
import pkgutil
from collections.abc import Sequence
from importlib.metadata import entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

import meshot.systems
from meshot.systems.protocol import SurfaceSystem
from meshot.train import Groups, changed_groups, read_groups

#: The entry point group for systems of other packages.
GROUP = "meshot.systems"


def system_names() -> list[str]:
    """The names of all systems, sorted."""
    return sorted(_systems())


def get_system(name: str) -> type[SurfaceSystem]:
    """The class of a system.

    Raises
    ------
    ValueError
        If no system has that name.
    """
    known = _systems()
    if name not in known:
        raise ValueError(f"there is no system {name!r}; known are {', '.join(sorted(known))}")
    return known[name]


def read_settings(kind: type[SurfaceSystem], config: str | os.PathLike, changes: Sequence[str] = ()) -> Groups:
    """The complete settings of a training.

    Parameters
    ----------
    kind : class
        For example ``get_system("ddot")``.
    config : path or str
        A YAML file, or the name of a configuration of the system, such as ``small``.
    changes : sequence of str
        Settings that replace those of the file, such as ``training.seed=1``.

    Raises
    ------
    ValueError
        If the file or configuration does not exist, it is not YAML, or a value is invalid.
    """
    path, packaged = Path(config), _packaged(kind)
    if path.suffix not in (".yaml", ".yml"):
        if str(config) not in packaged:
            raise ValueError(
                f"{kind.name} has no setting {str(config)!r}; it has {', '.join(sorted(packaged)) or 'none'}, or name "
                "a YAML file"
            )
        path = packaged[str(config)]
    try:
        return kind.complete(changed_groups(read_groups(path), changes))
    except ValueError as error:
        raise ValueError(f"{config}: {error}") from error


def _packaged(kind: type[SurfaceSystem]) -> dict[str, Traversable]:
    """The paths of the configurations in the folder of the system, by name."""
    module = importlib.import_module(kind.__module__)
    if not hasattr(module, "__path__"):
        return {}
    return {f.name.removesuffix(".yaml"): f for f in files(module).iterdir() if f.name.endswith(".yaml")}


def _systems() -> dict[str, type[SurfaceSystem]]:
    found = {}
    for entry in pkgutil.iter_modules(meshot.systems.__path__, "meshot.systems."):
        kind = getattr(importlib.import_module(entry.name), "System", None)
        if kind is not None:
            found[entry.name.rpartition(".")[2]] = kind
    return found | {entry.name: entry.load() for entry in entry_points(group=GROUP) if entry.name not in found}
