"""What a system is given: scans to find surfaces in, and examples to learn from."""

import dataclasses
from collections.abc import Mapping, Sequence

from meshot.anatomy import Hemisphere
from meshot.mesh import Mesh
from meshot.volume import Volume

#: Which surface: a hemisphere and a name, such as ``("left", "white")``.
SurfaceKey = tuple[Hemisphere, str]


@dataclasses.dataclass(frozen=True, eq=False)
class Scan:
    """What a system sees of a subject.

    Parameters
    ----------
    image : Volume
        On the standard grid, in [0, 1].
    initial : mapping
        Initial surfaces by key, in the space of the image, in mm. Empty where the system needs none.
    """

    image: Volume
    initial: Mapping[SurfaceKey, Mesh] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, eq=False)
class Example:
    """A subject whose true surfaces are known.

    Parameters
    ----------
    name : str
    scan : Scan
    targets : mapping
        True surfaces by key, of both hemispheres if they are known, in the space of the image, in mm.
    """

    name: str
    scan: Scan
    targets: Mapping[SurfaceKey, Mesh]


@dataclasses.dataclass(frozen=True, eq=False)
class ExampleSets:
    """The examples of a training: those that it learns from, and those that it is validated on."""

    training: Sequence[Example]
    validation: Sequence[Example]
