"""Random augmentation of training scans: rotation, scaling, deformation, reflection, translation, intensity."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch.nn.functional import grid_sample, interpolate

from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor

_BEND_NODES = 8  # control nodes along each axis
_BIAS_NODES = 4
_FIRST_SHARE = 0.5  # of scans as the first registration leaves them


@dataclasses.dataclass(frozen=True)
class Augmentation:
    """Ranges of the random augmentation of a training scan.

    Parameters
    ----------
    flip : float
        Probability, in [0, 1], of a reflection that exchanges left and right.
    shift : int
        Maximum translation along each axis, in voxels.
    intensity : float
        Maximum relative change of contrast (gamma) and brightness, in [0, 1).
    turn : float
        Maximum rotation about each axis, in degrees.
    stretch : float
        Maximum relative scaling along each axis, in [0, 1).
    shrink : float
        In half of the cases, the largest relative reduction of all axes together, in [0, 1). A first registration may
        make a head with its skull this much too small.
    contrast : float
        In the same cases, the largest change of the logarithm of the exponent gamma; a smooth bias field with a
        quarter of it as its largest logarithm. The contrast is adjusted only after the first registration.
    bend : float
        Standard deviation of a smooth displacement, in voxels.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    flip: float = 0.5
    shift: int = 4
    intensity: float = 0.2
    turn: float = 0.0
    stretch: float = 0.0
    shrink: float = 0.0
    contrast: float = 0.0
    bend: float = 0.0

    def __post_init__(self):
        if not (0 <= self.flip <= 1 and 0 <= self.intensity < 1 and 0 <= self.stretch < 1):
            raise ValueError(
                f"flip is {self.flip!r}, intensity {self.intensity!r}, stretch {self.stretch!r}; they must lie in "
                "[0, 1], [0, 1) and [0, 1)"
            )
        if isinstance(self.shift, bool) or not isinstance(self.shift, int) or not 0 <= self.shift <= 10_000:
            raise ValueError(f"shift is {self.shift!r}; a whole number of voxels from 0 to 10000 is needed")
        if not 0 <= self.shrink < 1:
            raise ValueError(f"shrink is {self.shrink!r}; a number in [0, 1) is needed")
        if not all(0 <= number < np.inf for number in (self.turn, self.bend, self.contrast)):
            raise ValueError(
                f"turn is {self.turn!r}, bend {self.bend!r}, contrast {self.contrast!r}; finite numbers >= 0 are needed"
            )


def augmented(
    image: Float[Tensor, "1 x y z"],
    fractions: Float[Tensor, "2 x y z"],
    generator: Generator,
    by: Augmentation,
) -> tuple[Float[Tensor, "1 x y z"], Float[Tensor, "2 x y z"]]:
    """Apply the same random augmentation to a scan and to its true fractions.

    A reflection of the first axis also exchanges the two maps, because a left hemisphere becomes a right one. Voxels
    that enter at a border are zero.
    """
    generator = numpy_generator(generator)
    mirror, moves = generator.random() < by.flip, generator.integers(-by.shift, by.shift + 1, 3).tolist()
    gamma, gain = 1 + by.intensity * generator.uniform(-1, 1, 2)
    image = (gain * image.clamp(min=0) ** gamma).clamp(max=1)
    first = (by.shrink > 0 or by.contrast > 0) and generator.random() < _FIRST_SHARE
    if first and by.contrast:
        image = _with_raw_contrast(image, generator, by.contrast)
    if by.turn or by.stretch or by.shrink or by.bend:
        image, fractions = _warped(torch.cat([image, fractions]), generator, by, first).split([1, 2])
    if mirror:
        image, fractions = image.flip(1), fractions.flip(0).flip(1)
    return _moved(image, moves), _moved(fractions, moves)


def _with_raw_contrast(image: Float[Tensor, "1 x y z"], generator: np.random.Generator, strength: float) -> Tensor:
    """Another gamma, and a bias field, as in a scan before its contrast is adjusted."""
    gamma = float(np.exp(strength * generator.uniform(-1, 1)))
    nodes = torch.from_numpy(generator.uniform(-strength / 4, strength / 4, (1, 1, *(_BIAS_NODES,) * 3))).to(image)
    bias = interpolate(nodes, size=tuple(image.shape[1:]), mode="trilinear", align_corners=True)[0]
    return (image**gamma * bias.exp()).clamp(max=1)


def _warped(values: Float[Tensor, "3 x y z"], generator: np.random.Generator, by: Augmentation, first: bool) -> Tensor:
    """Rotate, scale and deform about the centre of the grid, in voxels."""
    shape = values.shape[1:]
    turned = Rotation.from_euler("xyz", generator.uniform(-by.turn, by.turn, 3), degrees=True).as_matrix()
    matrix = turned * (1 + by.stretch * generator.uniform(-1, 1, 3))
    if first:
        matrix /= 1 - by.shrink * generator.random()
    axes = [torch.arange(n, dtype=values.dtype) - (n - 1) / 2 for n in shape]
    places = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1) @ torch.from_numpy(matrix).to(values).T
    nodes = torch.from_numpy(generator.normal(scale=by.bend, size=(1, 3, *(_BEND_NODES,) * 3))).to(values)
    bends = interpolate(nodes, size=tuple(shape), mode="trilinear", align_corners=True)[0].movedim(0, -1)
    # grid_sample expects the last axis first, and coordinates from -1 to 1 between the outermost voxels.
    halves = values.new_tensor([max(n - 1, 1) / 2 for n in shape])
    return grid_sample(values[None], ((places + bends) / halves).flip(-1)[None], align_corners=True)[0]


def _moved(values: Tensor, moves: Sequence[int]) -> Tensor:
    for axis, move in enumerate(moves, start=1):
        values = values.roll(move, dims=axis)
        entered = slice(0, move) if move > 0 else slice(values.shape[axis] + move, None)
        if move:
            values[(slice(None),) * axis + (entered,)] = 0
    return values
