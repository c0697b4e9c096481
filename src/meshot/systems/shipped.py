"""The trained weights in the package, and the default system."""

import json
import os
from pathlib import Path

from meshot.systems.protocol import SurfaceSystem
from meshot.systems.registry import get_system

#: The folder of the weights: a subfolder for each system, and ``manifest.json`` with the name of the default.
SHIPPED = Path(__file__).parent.parent / "weights"
MANIFEST = "manifest.json"


def default_system() -> str:
    """The name of the default system."""
    return json.loads((SHIPPED / MANIFEST).read_text(encoding="utf-8"))["default_system"]


def load_system(name: str | None = None, folder: str | os.PathLike | None = None) -> SurfaceSystem:
    """Load a trained system.

    Parameters
    ----------
    name : str, optional
        The name of the system. By default that of the package.
    folder : path, optional
        A folder written by :meth:`meshot.systems.SurfaceSystem.save`. By default the weights in the package.

    Raises
    ------
    ValueError
        If the system is unknown, there are no weights for it, or they belong to another system.
    """
    kind = get_system(default_system() if name is None else name)
    shipped = SHIPPED / kind.name
    if folder is None and not shipped.is_dir():
        raise ValueError(
            f"no weights of {kind.name} come with the package: train it (meshot train {kind.name} CONFIG --data COHORT "
            f"-o FOLDER) and name the folder (--weights FOLDER), or put them into {shipped.name}/ of the package's "
            "weights"
        )
    return kind.load(shipped if folder is None else folder)
