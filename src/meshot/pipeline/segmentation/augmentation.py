"""Another scan that might have been: turned, stretched, bent, mirrored, moved, brighter or darker."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch.nn.functional import grid_sample, interpolate

from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor

_BEND_NODES = 8  # along each axis


@dataclasses.dataclass(frozen=True)
class Augmentation:
    """By how much a training scan may be changed.

    Parameters
    ----------
    flip : float
        How often, in [0, 1], it is mirrored, left and right exchanged with it.
    shift : int
        By how many voxels along each axis it is moved at most.
    intensity : float
        By what part its contrast (gamma) and brightness vary at most, in [0, 1).
    turn : float
        By how many degrees it is turned at most, about each axis.
    stretch : float
        By what part each axis is stretched or squeezed at most, in [0, 1).
    bend : float
        The standard deviation, in voxels, of a smooth displacement.

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
    bend: float = 0.0

    def __post_init__(self):
        if not (0 <= self.flip <= 1 and 0 <= self.intensity < 1 and 0 <= self.stretch < 1):
            raise ValueError(
                f"flip is {self.flip!r}, intensity {self.intensity!r}, stretch {self.stretch!r}; they must lie in "
                "[0, 1], [0, 1) and [0, 1)"
            )
        if isinstance(self.shift, bool) or not isinstance(self.shift, int) or not 0 <= self.shift <= 10_000:
            raise ValueError(f"shift is {self.shift!r}; a whole number of voxels from 0 to 10000 is needed")
        if not (0 <= self.turn < np.inf and 0 <= self.bend < np.inf):
            raise ValueError(f"turn is {self.turn!r}, bend {self.bend!r}; finite numbers >= 0 are needed")


def augmented(
    image: Float[Tensor, "1 x y z"],
    fractions: Float[Tensor, "2 x y z"],
    generator: Generator,
    by: Augmentation,
) -> tuple[Float[Tensor, "1 x y z"], Float[Tensor, "2 x y z"]]:
    """A scan and its truth, changed alike.

    Mirroring the first axis makes a left hemisphere a right one, so that the two maps change places with it. What
    moves in at a border is empty.
    """
    generator = numpy_generator(generator)
    mirror, moves = generator.random() < by.flip, generator.integers(-by.shift, by.shift + 1, 3).tolist()
    gamma, gain = 1 + by.intensity * generator.uniform(-1, 1, 2)
    image = (gain * image.clamp(min=0) ** gamma).clamp(max=1)
    if by.turn or by.stretch or by.bend:
        image, fractions = _warped(torch.cat([image, fractions]), generator, by).split([1, 2])
    if mirror:
        image, fractions = image.flip(1), fractions.flip(0).flip(1)
    return _moved(image, moves), _moved(fractions, moves)


def _warped(values: Float[Tensor, "3 x y z"], generator: np.random.Generator, by: Augmentation) -> Tensor:
    """Turned, stretched and bent about the middle of the grid, in voxels."""
    shape = values.shape[1:]
    turned = Rotation.from_euler("xyz", generator.uniform(-by.turn, by.turn, 3), degrees=True).as_matrix()
    matrix = turned * (1 + by.stretch * generator.uniform(-1, 1, 3))
    axes = [torch.arange(n, dtype=values.dtype) - (n - 1) / 2 for n in shape]
    places = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1) @ torch.from_numpy(matrix).to(values).T
    nodes = torch.from_numpy(generator.normal(scale=by.bend, size=(1, 3, *(_BEND_NODES,) * 3))).to(values)
    bends = interpolate(nodes, size=tuple(shape), mode="trilinear", align_corners=True)[0].movedim(0, -1)
    # grid_sample wants the last axis first, and a grid from -1 to 1 between the outermost voxels.
    halves = values.new_tensor([max(n - 1, 1) / 2 for n in shape])
    return grid_sample(values[None], ((places + bends) / halves).flip(-1)[None], align_corners=True)[0]


def _moved(values: Tensor, moves: Sequence[int]) -> Tensor:
    for axis, move in enumerate(moves, start=1):
        values = values.roll(move, dims=axis)
        entered = slice(0, move) if move > 0 else slice(values.shape[axis] + move, None)
        if move:
            values[(slice(None),) * axis + (entered,)] = 0
    return values
