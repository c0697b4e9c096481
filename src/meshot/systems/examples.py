"""The inputs of a system: scans, and examples for training."""

import dataclasses
from collections.abc import Mapping, Sequence

from meshot.anatomy import Hemisphere
from meshot.mesh import Mesh
from meshot.volume import Volume

#: The key of a surface: hemisphere and name, such as ``("left", "white")``.
SurfaceKey = tuple[Hemisphere, str]


def listed(keys: Sequence[SurfaceKey]) -> str:
    """Surfaces in words, such as ``left white, right white``."""
    return ", ".join(" ".join(key) for key in keys)


@dataclasses.dataclass(frozen=True, eq=False)
class Scan:
    """The input of a system for one subject.

    Parameters
    ----------
    image : Volume
        On the standard grid, in [0, 1].
    initial : mapping
        Initial surfaces by key, in the space of the image, in mm. Empty if the system needs none.
    """

    image: Volume
    initial: Mapping[SurfaceKey, Mesh] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, eq=False)
class Example:
    """A subject with known true surfaces.

    Parameters
    ----------
    name : str
    scan : Scan
    targets : mapping
        True surfaces by key, in the space of the image, in mm.
    """

    name: str
    scan: Scan
    targets: Mapping[SurfaceKey, Mesh]


@dataclasses.dataclass(frozen=True, eq=False)
class ExampleSets:
    """The examples of a training, and those of its validation."""

    training: Sequence[Example]
    validation: Sequence[Example]
