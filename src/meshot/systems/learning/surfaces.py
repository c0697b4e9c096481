"""The surfaces that a training is for: the white ones of both sides, or the white and the pial ones."""

from collections.abc import Mapping

from meshot.anatomy import HEMISPHERES
from meshot.systems.examples import SurfaceKey

#: The surfaces of a side that a system can find together.
SURFACES = (("white",), ("white", "pial"))


def checked_surfaces(surfaces: object) -> tuple[str, ...]:
    """The surfaces of a side as a tuple; YAML and JSON give a list.

    Raises
    ------
    ValueError
        If they are none of those that a system can find together.
    """
    if not isinstance(surfaces, list | tuple) or tuple(surfaces) not in SURFACES:
        raise ValueError(
            f"surfaces is {surfaces!r}; [white] or [white, pial] is needed: pial surfaces are found together with the "
            "white ones"
        )
    return tuple(surfaces)


def surfaces_of_sides(group: Mapping) -> tuple[SurfaceKey, ...]:
    """The surfaces of both sides that a group of settings names by ``surfaces``; white surfaces by default.

    Raises
    ------
    ValueError
        As :func:`checked_surfaces`.
    """
    kinds = checked_surfaces(group.get("surfaces", SURFACES[0]))
    return tuple((side, kind) for side in HEMISPHERES for kind in kinds)
