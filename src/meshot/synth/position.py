"""Random position of a head in the scanner, and the grid of the image."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Tensor
from meshot.volume import Volume

_AXES = {"R": (0, 1), "L": (0, -1), "A": (1, 1), "P": (1, -1), "S": (2, 1), "I": (2, -1)}


@dataclasses.dataclass(frozen=True)
class Position:
    """Parameters of the random position of a head, and of the grid.

    Parameters
    ----------
    rotation_degrees : float
        Maximum rotation of the head about each axis.
    translation_mm : float
        Maximum translation of the head along each axis.
    oblique_degrees : float
        Maximum rotation of the grid about each axis.
    voxel_mm : three numbers
        Voxel sizes along the axes of the grid.
    orientation : str
        Directions of the three axes of the grid, up to the oblique rotation: three of the letters R or L, A or P, S or
        I.
    margin_mm : float
        Distance by which the grid exceeds the head.

    Raises
    ------
    ValueError
        If a number is out of range, or the letters do not specify three axes.
    """

    rotation_degrees: float = 8.0
    translation_mm: float = 10.0
    oblique_degrees: float = 0.0
    voxel_mm: tuple[float, float, float] = (1.0, 1.0, 1.0)
    orientation: str = "RAS"
    margin_mm: float = 10.0

    def __post_init__(self):
        angles = (self.rotation_degrees, self.oblique_degrees)
        if not all(0 <= angle <= 30 for angle in angles) or not 0 <= self.translation_mm <= 100:
            raise ValueError(
                f"rotations are up to {angles} degrees and the translation up to {self.translation_mm} mm; 0 to 30 "
                "degrees (the registration finds no more) and 0 to 100 mm are needed"
            )
        if len(self.voxel_mm) != 3 or not all(0.3 <= size <= 10 for size in self.voxel_mm):
            raise ValueError(f"voxel_mm is {self.voxel_mm}; three sizes from 0.3 to 10 mm are needed")
        if not 0 <= self.margin_mm <= 100:
            raise ValueError(f"margin_mm is {self.margin_mm}; 0 to 100 mm are needed")
        axes = [_AXES[letter][0] for letter in str(self.orientation) if letter in _AXES]
        if len(str(self.orientation)) != 3 or sorted(axes) != [0, 1, 2]:
            raise ValueError(
                f"orientation is {self.orientation!r}; one letter of each of the pairs RL, AP, SI is needed, such as "
                "RAS, LAS or PIR"
            )


def head_position(position: Position, centre_mm: Float[Array, " 3"], generator: Generator) -> Float[Array, "4 4"]:
    """A random rigid motion from head coordinates to scanner RAS, in mm, with rotation about ``centre_mm``."""
    rng = numpy_generator(generator)
    motion = np.eye(4)
    motion[:3, :3] = _rotation(position.rotation_degrees, rng)
    shift = position.translation_mm * rng.uniform(-1, 1, 3)
    motion[:3, 3] = centre_mm + shift - motion[:3, :3] @ centre_mm
    return motion


def scanner_grid(position: Position, points_mm: Float[Tensor, "n 3"], generator: Generator) -> Volume:
    """An empty volume that contains all points with a margin, in the orientation of ``position``.

    Parameters
    ----------
    position : Position
    points_mm : tensor
        The points in scanner RAS.
    generator : generator or int
        Source of the random oblique rotation.
    """
    axes = np.zeros((3, 3))
    for column, letter in enumerate(position.orientation):
        axis, sign = _AXES[letter]
        axes[axis, column] = sign
    axes = _rotation(position.oblique_degrees, numpy_generator(generator)) @ axes
    sizes = np.array(position.voxel_mm, dtype=np.float64)
    along = points_mm.detach().double().cpu().numpy() @ axes
    low = np.floor((along.min(axis=0) - position.margin_mm) / sizes)
    shape = (np.ceil((along.max(axis=0) + position.margin_mm) / sizes) - low + 1).astype(int)
    affine = np.eye(4)
    affine[:3, :3] = axes * sizes
    affine[:3, 3] = axes @ (low * sizes)
    # A file header stores 32-bit numbers; use the same values in the computation.
    return Volume(np.zeros(shape.tolist(), dtype=np.uint8), affine.astype(np.float32).astype(np.float64))


def _rotation(degrees: float, rng: np.random.Generator) -> Float[Array, "3 3"]:
    return Rotation.from_euler("xyz", degrees * rng.uniform(-1, 1, 3), degrees=True).as_matrix()
