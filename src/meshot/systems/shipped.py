"""The weights that come with the package: which systems have some, and which system is meant where none is named."""

import json
import os
from pathlib import Path

from meshot.systems.protocol import SurfaceSystem
from meshot.systems.registry import get_system

#: One folder for each system with weights, and ``manifest.json``, which names the default.
SHIPPED = Path(__file__).parent.parent / "weights"
MANIFEST = "manifest.json"


def default_system() -> str:
    """The name of the system that is meant where none is named."""
    return json.loads((SHIPPED / MANIFEST).read_text(encoding="utf-8"))["default_system"]


def load_system(name: str | None = None, folder: str | os.PathLike | None = None) -> SurfaceSystem:
    """A trained system.

    Parameters
    ----------
    name : str, optional
        The default of the package if left out.
    folder : path, optional
        What :meth:`meshot.systems.SurfaceSystem.save` wrote; the weights that come with the package if left out.

    Raises
    ------
    ValueError
        If no system has that name, there are no weights for it, or they are of another system.
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
