"""Directions of view. World axes are scanner RAS: +x is right, +y anterior, +z superior."""

import dataclasses

import numpy as np

from meshot.types import Array, Float

# Direction from the surface to the camera, and the upward direction of the picture.
_EYES = {
    "left": ((-1, 0, 0), (0, 0, 1)),
    "right": ((1, 0, 0), (0, 0, 1)),
    "anterior": ((0, 1, 0), (0, 0, 1)),
    "posterior": ((0, -1, 0), (0, 0, 1)),
    "superior": ((0, 0, 1), (0, 1, 0)),
    "inferior": ((0, 0, -1), (0, 1, 0)),
}
_SIDES = {("lateral", "left"): "left", ("lateral", "right"): "right"}
_SIDES |= {("medial", "left"): "right", ("medial", "right"): "left"}
_LETTERS = ("LR", "PA", "IS")


@dataclasses.dataclass(frozen=True, eq=False)
class View:
    """A direction of view.

    Parameters
    ----------
    name : str
        The requested name, such as "lateral".
    axes : array
        Orthonormal rows: right and up in the picture, and towards the camera.
    """

    name: str
    axes: Float[Array, "3 3"]

    def letters(self) -> tuple[str, str, str, str]:
        """The anatomical letters at the left, right, bottom and top edges of the picture, such as A, P, I, S."""
        letters = []
        for row in self.axes[:2]:
            axis = int(np.abs(row).argmax())
            ends = _LETTERS[axis]
            letters += list(ends if row[axis] > 0 else ends[::-1])
        return tuple(letters)


def view_from(name: str, hemisphere: str | None = None) -> View:
    """The view with a name.

    Parameters
    ----------
    name : str
        Position of the camera: "left", "right", "anterior", "posterior", "superior", "inferior"; or, for a hemisphere
        of a brain, "lateral" (from outside) or "medial" (from the other hemisphere).
    hemisphere : str, optional
        "left" or "right", required for the last two.

    Raises
    ------
    ValueError
        If the name is unknown, or "lateral" or "medial" is given without a hemisphere.
    """
    if name in ("lateral", "medial") and hemisphere not in ("left", "right"):
        raise ValueError(f"view is {name!r} and hemisphere {hemisphere!r}; say hemisphere='left' or 'right'")
    direction = _SIDES.get((name, hemisphere), name)
    if direction not in _EYES:
        raise ValueError(f"view is {name!r}; one of {', '.join([*_EYES, 'lateral', 'medial'])} is needed")
    towards, up = (np.array(axis, dtype=float) for axis in _EYES[direction])
    return View(name, np.stack([np.cross(up, towards), up, towards]))
