"""Closed contours with known lengths, used in the 2D experiments of the book."""

import math

import numpy as np
import torch

from meshot.errors import require_positive, require_positive_integer
from meshot.mesh.mesh import Contour, closed_contour
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor


def regular_polygon(n_corners: int, radius: float = 1.0) -> Contour:
    """A polygon with equal sides and angles, counter-clockwise, with its first corner directly above the origin.

    Parameters
    ----------
    n_corners : int
        At least three; the perimeter is 2 · n_corners · radius · sin(π / n_corners).
    radius : float
        Distance of every corner from the origin.

    Raises
    ------
    ValueError
        If there are fewer than three corners, or the radius is not positive.
    """
    _require_corners(n_corners, "n_corners", 3)
    require_positive(radius, "radius", "units of the vertices")
    return closed_contour(_polar(np.full(n_corners, radius), _even_angles(n_corners)))


def circle(radius: float = 1.0, n_corners: int = 720) -> Contour:
    """A circle, approximated by a regular polygon. With 720 corners its length is 3 · 10⁻⁶ below 2π · radius, relative.

    Raises
    ------
    ValueError
        As :func:`regular_polygon`.
    """
    return regular_polygon(n_corners, radius)


def star(n_tips: int, outer_radius: float = 1.0, inner_radius: float = 0.4) -> Contour:
    """A star with ``n_tips`` equal tips and corners alternately on two circles. The first tip is above the origin.

    Parameters
    ----------
    n_tips : int
        At least two.
    outer_radius, inner_radius : float
        Radius of the tips, and of the corners between them. A smaller inner radius gives sharper tips.

    Raises
    ------
    ValueError
        If there are fewer than two tips, or 0 < ``inner_radius`` < ``outer_radius`` does not hold.
    """
    _require_corners(n_tips, "n_tips", 2)
    if not 0 < inner_radius < outer_radius:
        raise ValueError(
            f"inner_radius is {inner_radius!r} and outer_radius {outer_radius!r}; 0 < inner_radius < outer_radius is "
            "needed: swap them, or use regular_polygon where they are equal"
        )
    return closed_contour(_polar(np.tile([outer_radius, inner_radius], n_tips), _even_angles(2 * n_tips)))


def near_regular_polygon(n_corners: int, jitter: float, generator: Generator, radius: float = 1.0) -> Contour:
    """A regular polygon whose corners are moved radially by random amounts up to ``jitter`` · ``radius``.

    Parameters
    ----------
    n_corners : int
        At least three.
    jitter : float
        In [0, 1): each corner's distance from the origin is uniform in ``radius`` · [1 − jitter, 1 + jitter].
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    radius : float
        Of the regular polygon.

    Raises
    ------
    ValueError
        If there are fewer than three corners, the radius is not positive, or ``jitter`` is outside [0, 1).
    """
    _require_corners(n_corners, "n_corners", 3)
    if not 0 <= jitter < 1:
        raise ValueError(f"jitter is {jitter!r}; a number in [0, 1) is needed, as a share of the radius")
    require_positive(radius, "radius", "units of the vertices")
    radii = radius * (1 + jitter * numpy_generator(generator).uniform(-1, 1, n_corners))
    return closed_contour(_polar(radii, _even_angles(n_corners)))


def letter_e(width: float = 1.4, height: float = 2.0, stroke: float = 0.3) -> Contour:
    """The outline of a capital E with three bars of equal thickness, centred on the origin. Not convex, twelve corners.

    Parameters
    ----------
    width, height : float
        Size of the bounding box. The perimeter is 2 · height + 6 · width − 4 · stroke.
    stroke : float
        Thickness of the stem and of the bars, less than a third of the height and less than the width.

    Raises
    ------
    ValueError
        If the bars would touch, or a length is not positive.
    """
    if not (0 < stroke < width and 3 * stroke < height):
        raise ValueError(
            f"width is {width!r}, height {height!r}, stroke {stroke!r}; 0 < stroke < width and 3 stroke < height are "
            "needed, so that there is room between the bars"
        )
    right, top, stem, half = width / 2, height / 2, stroke - width / 2, stroke / 2
    outline = [
        (-right, -top),
        (right, -top),
        (right, stroke - top),
        (stem, stroke - top),
        (stem, -half),
        (right, -half),
    ]
    mirrored = [(x, -y) for x, y in reversed(outline)]
    return closed_contour(torch.tensor(outline + mirrored, dtype=torch.float64))


def _even_angles(n_corners: int) -> np.ndarray:
    return math.pi / 2 + 2 * math.pi * np.arange(n_corners) / n_corners


def _polar(radii: np.ndarray, angles: np.ndarray) -> Float[Tensor, "n 2"]:
    return torch.from_numpy(np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1))


def _require_corners(count: int, name: str, least: int) -> None:
    require_positive_integer(count, name)
    if count < least:
        raise ValueError(f"{name} is {count}; at least {least} are needed to enclose an area")
