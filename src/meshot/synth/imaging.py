"""Simulation of T1-weighted images: tissue fractions, signal, artefacts and noise.

Every step is a function from arrays to an array, so that parameters can be studied one at a time.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.interpolate
import scipy.ndimage

from meshot.mesh import Mesh
from meshot.rng import Generator, numpy_generator
from meshot.synth.myelin import share_near_grey
from meshot.synth.structures import Ellipsoids
from meshot.types import Array, Float, Tensor
from meshot.volume import Volume, voxel_sizes
from meshot.volume.surfaces import enclosed_fractions

TISSUES = ("white", "grey", "deep grey", "hindbrain", "fluid", "skull", "scalp")
#: Tissues of the cerebellum and the brainstem if these are not uniform, and the tissues whose signal they have.
SAME_SIGNAL = {"hindbrain white": "white", "hindbrain grey": "grey"}
SULCI_MM = 4.0
FWHM = 2 * np.sqrt(2 * np.log(2))


@dataclasses.dataclass(frozen=True)
class Appearance:
    """Parameters of an image: tissue signals, and artefacts of the scanner.

    Parameters
    ----------
    signal : mapping
        Mean signal of each of ``TISSUES``, in arbitrary units; air is 0.
    texture, texture_mm : float
        Standard deviation of the signal within a tissue, relative to its mean, and its correlation length in mm.
    bias, bias_mm : float
        Standard deviation of the logarithm of the bias field, and its correlation length in mm.
    blur_mm : float
        Full width at half maximum of the point spread function, in mm.
    noise : float
        Standard deviation of the noise in each of the two channels of the receiver, in units of the signal.
    gamma : float, optional
        Exponent of the signal relative to its largest mean, before blurring: other weightings than those of the means.
    motion_mm : float, optional
        Standard deviation of the displacement of the head, along each axis, at two moments of the scan.
    white_gradient : float, optional
        How far white matter at the white surface is on the way to the signal of grey matter, in [0, 1]. White matter
        right below the cortex has less myelin than deep white matter. It decays with the depth, over 1 to 2 mm.
    """

    signal: dict[str, float]
    texture: float = 0.03
    texture_mm: float = 3.0
    bias: float = 0.1
    bias_mm: float = 60.0
    blur_mm: float = 1.2
    noise: float = 3.0
    gamma: float | None = None
    motion_mm: float | None = None
    white_gradient: float | None = None

    def __post_init__(self):
        if set(self.signal) != set(TISSUES):
            raise ValueError(f"signal names {sorted(self.signal)}; each of {sorted(TISSUES)} is needed once")
        sizes = [*self.signal.values(), self.texture, self.bias, self.blur_mm, self.noise, self.motion_mm or 0.0]
        lengths = (self.texture_mm, self.bias_mm, 1.0 if self.gamma is None else self.gamma)
        if not all(np.isfinite(x) and x >= 0 for x in sizes) or not min(lengths) > 0:
            raise ValueError(f"{self} is not possible: signals and strengths are >= 0, lengths and gamma > 0")
        if not 0 <= (self.white_gradient or 0) <= 1:
            raise ValueError(f"{self} is not possible: white_gradient is between 0 and 1")


@runtime_checkable
class Interior(Protocol):
    """Everything in a head but its cortex."""

    def ends(self) -> Float[Tensor, "n 3"]:
        """Points whose bounding box contains it, in scanner RAS."""

    def added_to(
        self, fractions: Mapping[str, Float[Array, "X Y Z"]], inside_pial: Float[Array, "X Y Z"], grid: Volume
    ) -> dict[str, Float[Array, "X Y Z"]]:
        """Tissue fractions in which it replaces white matter, or lies outside the pial surfaces."""


def tissue_fractions(
    white: Sequence[Mesh],
    pial: Sequence[Mesh],
    grid: Volume,
    head_mm: Sequence[float] = (),
    n_lines: int = 3,
    inner: Interior | None = None,
    sulci_mm: float = SULCI_MM,
) -> dict[str, Float[Array, "X Y Z"]]:
    """The fractions of every voxel that belong to each of ``TISSUES``; the rest is air.

    Parameters
    ----------
    white, pial : sequence of Mesh
        Closed, one per hemisphere, in scanner RAS.
    grid : Volume
        Defines the grid. Its data are not used.
    head_mm : sequence of float
        Thickness of fluid, skull and scalp around the pial surfaces. Empty for a brain in air.
    n_lines : int
        Number of lines across each voxel, see :func:`meshot.volume.surfaces.enclosed_fractions`.
    inner : Interior, optional
        Further structures, which replace white matter or lie below the brain.
    sulci_mm : float
        The largest width of a sulcus that is filled with fluid if the brain is in air.

    Raises
    ------
    ValueError
        If ``head_mm`` has neither three numbers nor none, or a mesh is not closed.
    """
    if len(head_mm) not in (0, 3) or any(not thickness > 0 for thickness in head_mm):
        raise ValueError(f"head_mm is {list(head_mm)}; three thicknesses > 0 (fluid, skull, scalp) or none are needed")
    inside_white = sum(enclosed_fractions(mesh, grid, n_lines) for mesh in white)
    inside_pial = sum(enclosed_fractions(mesh, grid, n_lines) for mesh in pial)
    inside_white = np.clip(inside_white, 0, 1)
    inside_pial = np.clip(np.maximum(inside_pial, inside_white), 0, 1)
    cortex = {"white": inside_white, "grey": inside_pial - inside_white}
    fractions = (inner or Ellipsoids(())).added_to(cortex, inside_pial, grid)
    covered = sum(fractions.values())
    fluid, skull, scalp = (
        layer * (1 - covered) for layer in _shells(covered, voxel_sizes(grid), head_mm, sulci_mm / 2)
    )
    return fractions | {"fluid": fractions["fluid"] + fluid, "skull": skull, "scalp": scalp}


def _shells(inside: Array, sizes: Array, head_mm: Sequence[float], reach: float) -> list[Array]:
    """Fractions of fluid, skull and scalp, each with an edge one voxel wide."""
    sampling = sizes.tolist()
    # The surface is half a voxel from the centre of the nearest voxel inside.
    distance = scipy.ndimage.distance_transform_edt(inside < 0.5, sampling=sampling) - sizes.mean() / 2
    if not len(head_mm):
        closed = scipy.ndimage.distance_transform_edt(distance <= reach, sampling=sampling)
        return [_below(reach - closed, 0.0, sizes), np.zeros_like(distance), np.zeros_like(distance)]
    ends = [_below(distance, end, sizes) for end in np.cumsum(head_mm)]
    return [ends[0], ends[1] - ends[0], ends[2] - ends[1]]


def _below(distance: Array, end: float, sizes: Array) -> Array:
    return np.clip(0.5 + (end - distance) / float(sizes.mean()), 0, 1)


def t1_image(
    fractions: dict[str, Float[Array, "X Y Z"]], grid: Volume, appearance: Appearance, generator: Generator
) -> Volume:
    """A T1-weighted magnitude image: partial-volume signal, texture, bias field, point spread, Rician noise.

    Parameters
    ----------
    fractions : dict
        See :func:`meshot.synth.tissue_fractions`.
    grid : Volume
        The grid they are on.
    appearance : Appearance
    generator : generator or int
        Random number generator; an integer is a seed.
    """
    rng, sizes = numpy_generator(generator), voxel_sizes(grid)
    shape = grid.data.shape
    signal = np.zeros(shape)
    means = appearance.signal | {tissue: appearance.signal[like] for tissue, like in SAME_SIGNAL.items()}
    for tissue in (t for t in (*TISSUES, *SAME_SIGNAL) if t in fractions and fractions[t].any()):
        varied = 1 + appearance.texture * smooth_noise(shape, appearance.texture_mm / sizes, rng)
        signal += means[tissue] * fractions[tissue] * varied
    if appearance.white_gradient:
        lost = appearance.white_gradient * share_near_grey(fractions["white"], fractions["grey"], sizes)
        signal -= (appearance.signal["white"] - appearance.signal["grey"]) * lost
    if appearance.gamma is not None:
        top = max(means.values())
        signal = top * (np.maximum(signal, 0) / top) ** appearance.gamma
    signal *= np.exp(appearance.bias * smooth_noise(shape, appearance.bias_mm / sizes, rng))
    signal = scipy.ndimage.gaussian_filter(signal, appearance.blur_mm / FWHM / sizes)
    if appearance.motion_mm:
        signal = with_motion(signal, appearance.motion_mm / sizes, rng)
    return grid.with_data(rician_noise(signal, appearance.noise, rng).astype(np.float32))


def smooth_noise(shape: Sequence[int], length: Float[Array, " 3"], generator: Generator) -> Float[Array, "X Y Z"]:
    """A smooth random field of mean 0 and standard deviation 1 on a grid.

    It interpolates independent normal numbers on knots ``length`` voxels apart by cubic splines. The cost does not
    increase with ``length``.
    """
    rng = numpy_generator(generator)
    step = np.maximum(np.asarray(length, dtype=np.float64), 1.0)
    knots = rng.standard_normal(tuple(np.ceil(np.array(shape) / step).astype(int) + 4))
    for axis, (count, width) in enumerate(zip(shape, step, strict=True)):
        places = 1.5 + np.arange(count) / width
        knots = scipy.interpolate.CubicSpline(np.arange(knots.shape[axis]), knots, axis=axis)(places)
    return (knots - knots.mean()) / knots.std()


def with_motion(
    signal: Float[Array, "X Y Z"], spread: Float[Array, " 3"], generator: Generator
) -> Float[Array, "X Y Z"]:
    """The magnitude of an image of a head that moves at two moments of the scan.

    The planes of its Fourier transform along the second axis are measured one after the other. A displacement
    multiplies the later ones by a phase. The head is in its place when the middle plane is measured.

    Parameters
    ----------
    signal : array
    spread : array
        Standard deviation of each displacement, in voxels.
    generator : generator or int
    """
    rng = numpy_generator(generator)
    frequencies = [np.fft.fftfreq(n) for n in signal.shape]
    order = np.argsort(frequencies[1])
    transform, middle = np.fft.fftn(signal), len(order) // 2
    for begin, end in ((0, rng.integers(1, middle)), (rng.integers(middle + 1, len(order)), len(order))):
        shift = spread * rng.standard_normal(3)
        phases = [np.exp(-2j * np.pi * f * d) for f, d in zip(frequencies, shift, strict=True)]
        planes = order[begin:end]
        factor = phases[0][:, None, None] * phases[1][None, planes, None] * phases[2][None, None, :]
        transform[:, planes] *= factor
    return np.abs(np.fft.ifftn(transform))


def rician_noise(signal: Float[Array, "*shape"], sigma: float, generator: Generator) -> Float[Array, "*shape"]:
    """The magnitude of a signal with normal noise of standard deviation ``sigma`` in both channels of the receiver.

    Without signal the values follow a Rayleigh distribution with mean σ √(π/2).

    References
    ----------
    Gudbjartsson and Patz, *The Rician distribution of noisy MRI data*, Magnetic Resonance in Medicine, 1995.
    """
    rng = numpy_generator(generator)
    real = signal + sigma * rng.standard_normal(signal.shape)
    return np.hypot(real, sigma * rng.standard_normal(signal.shape))
