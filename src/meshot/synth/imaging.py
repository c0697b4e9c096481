"""Simulation of T1-weighted images: tissue fractions, signal, artefacts and noise.

Every step is a function from arrays to an array, so that parameters can be studied one at a time.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.interpolate
import scipy.ndimage
import torch

from meshot.mesh import Mesh
from meshot.rng import Generator, numpy_generator
from meshot.settings import Settings
from meshot.types import Array, Float, Tensor
from meshot.volume import Volume, enclosed_fractions, mm_to_voxel, voxel_sizes

TISSUES = ("white", "grey", "deep grey", "hindbrain", "fluid", "skull", "scalp")
#: Tissues of the cerebellum and the brainstem if these are not uniform, and the tissues whose signal they have.
SAME_SIGNAL = {"hindbrain white": "white", "hindbrain grey": "grey"}
SULCI_MM = 4.0
FWHM = 2 * np.sqrt(2 * np.log(2))


@dataclasses.dataclass(frozen=True)
class Appearance(Settings):
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
        Number of lines across each voxel, see :func:`meshot.volume.enclosed_fractions`.
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
    # Fractions of fluid, skull and scalp, each with an edge one voxel wide. The surface is half a voxel from the centre
    # of the nearest voxel inside.
    sizes, reach = voxel_sizes(grid), sulci_mm / 2
    sampling = sizes.tolist()
    distance = scipy.ndimage.distance_transform_edt(covered < 0.5, sampling=sampling) - sizes.mean() / 2
    if len(head_mm):
        ends = [_below(distance, end, sizes) for end in np.cumsum(head_mm)]
        layers = [ends[0], ends[1] - ends[0], ends[2] - ends[1]]
    else:
        closed = scipy.ndimage.distance_transform_edt(distance <= reach, sampling=sampling)
        layers = [_below(reach - closed, 0.0, sizes), np.zeros_like(distance), np.zeros_like(distance)]
    fluid, skull, scalp = (layer * (1 - covered) for layer in layers)
    return fractions | {"fluid": fractions["fluid"] + fluid, "skull": skull, "scalp": scalp}


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
    """A smooth random field of mean 0 and standard deviation 1 on a grid."""
    # It interpolates independent normal numbers on knots ``length`` voxels apart by cubic splines. The cost does not
    # increase with ``length``.
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
    """The magnitude of an image of a head that moves at two moments of the scan."""
    # The planes of its Fourier transform along the second axis are measured one after the other. A displacement
    # multiplies the later ones by a phase. The head is in its place when the middle plane is measured.
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
    """The magnitude of a signal with normal noise of standard deviation ``sigma`` in both channels of the receiver."""
    # Without signal the values follow a Rayleigh distribution with mean σ √(π/2).
    rng = numpy_generator(generator)
    real = signal + sigma * rng.standard_normal(signal.shape)
    return np.hypot(real, sigma * rng.standard_normal(signal.shape))


# What real scans have and clean heads lack: leftovers of skull stripping, cuts that are too deep, vessels, lesions.

_PATCH_MM = 25.0  # size of the patches of dura and of cuts
_LESION_MM = 6.0
_LESION_DEPTH_MM = 4.0  # lesions lie at least as deep in white matter
_STEPS, _STEP_MM = 60, 1.0  # along a vessel
_STIFFNESS = 0.9  # of a vessel: the share of its direction that a step keeps
_RADII_MM = (0.5, 1.5)  # of a vessel


@dataclasses.dataclass(frozen=True)
class Blemishes:
    """Sizes of the blemishes of one scan. With 0 there are none of that kind.

    Parameters
    ----------
    dura : float
        The share of the outer surface of the brain on which a layer of dura and marrow is left.
    dura_mm : float
        The thickness of that layer.
    cut : float
        The share of the outer surface on which skull stripping removed brain.
    cut_mm : float
        How deep it cut.
    vessels : int
        Number of bright vessels on the surface of the brain, 60 mm long and 1 to 3 mm wide.
    lesions : float
        The share of deep white matter that has the signal of grey matter.
    """

    dura: float = 0.0
    dura_mm: float = 3.0
    cut: float = 0.0
    cut_mm: float = 2.0
    vessels: int = 0
    lesions: float = 0.0

    def __post_init__(self):
        for name in ("dura", "cut", "lesions"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name)!r}; a share in [0, 1] is needed")
        if not (0 <= self.dura_mm < np.inf and 0 <= self.cut_mm < np.inf and self.vessels >= 0):
            raise ValueError(f"{self} is not possible: lengths and the number of vessels are >= 0")


Fractions = dict[str, Float[Array, "X Y Z"]]


def blemished(
    fractions: Mapping[str, Float[Array, "X Y Z"]], grid: Volume, blemishes: Blemishes, generator: Generator
) -> Fractions:
    """Tissue fractions after lesions, vessels, leftovers and cuts, in this order."""
    rng, sizes, found = numpy_generator(generator), voxel_sizes(grid), dict(fractions)
    air = np.clip(1 - sum(found.values()), 0, 1)
    bare = 1 - sum(found[name] for name in ("skull", "scalp")) - air
    if not (bare > 0.5).any():
        raise ValueError("the fractions contain no brain; blemishes need one")
    if blemishes.lesions > 0:
        deep = scipy.ndimage.distance_transform_edt(found["white"] > 0.5, sampling=sizes.tolist()) > _LESION_DEPTH_MM
        if deep.any():
            field = smooth_noise(deep.shape, _LESION_MM / sizes, rng)
            chosen = deep & (field > np.quantile(field[deep], 1 - blemishes.lesions))
            moved = found["white"] * scipy.ndimage.gaussian_filter(chosen.astype(np.float64), 0.5)
            found |= {"white": found["white"] - moved, "deep grey": found["deep grey"] + moved}
    outside = scipy.ndimage.distance_transform_edt(bare < 0.5, sampling=sizes.tolist())
    if blemishes.vessels:
        # Random walks that stay near the surface of the brain.
        starts, total = np.argwhere((outside > 0) & (outside <= 2)), np.zeros(outside.shape)
        for _ in range(blemishes.vessels):
            place = starts[rng.integers(len(starts))] * sizes
            heading, path, last = rng.standard_normal(3), [], np.array(outside.shape) - 1
            for _ in range(_STEPS):
                index = np.clip(np.round(place / sizes), 0, last).astype(int)
                ends = np.clip(index + np.array([-1, 1])[:, None, None] * np.eye(3, dtype=int), 0, last)
                slope = outside[tuple(ends[1].T)] - outside[tuple(ends[0].T)]
                away = slope / max(np.linalg.norm(slope), 1e-9)
                heading = _STIFFNESS * heading + (1 - _STIFFNESS) * rng.standard_normal(3)
                heading -= (heading @ away) * away + 0.2 * (outside[tuple(index)] - 1.5) * away
                heading /= max(np.linalg.norm(heading), 1e-9)
                path.append(index)
                place = place + _STEP_MM * heading
            path = np.array(path)
            radius = rng.uniform(*_RADII_MM)
            # In a box around the path: the share of each voxel that lies within the radius of the path.
            margin = np.ceil(radius / sizes).astype(int) + 2
            low = np.maximum(path.min(axis=0) - margin, 0)
            high = np.minimum(path.max(axis=0) + margin + 1, outside.shape)
            free = np.ones(high - low, dtype=bool)
            free[tuple((path - low).T)] = False
            distance = scipy.ndimage.distance_transform_edt(free, sampling=sizes.tolist())
            box = tuple(slice(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True))
            total[box] = np.maximum(total[box], np.clip(0.5 + (radius - distance) / sizes.mean(), 0, 1))
        found = _replaced(found, "scalp", total)
    if blemishes.dura > 0:
        layer = (outside > 0) & (outside <= blemishes.dura_mm) & _patches(bare.shape, sizes, blemishes.dura, rng)
        found = _replaced(found, "scalp", layer.astype(np.float64))
    if blemishes.cut > 0:
        inside = scipy.ndimage.distance_transform_edt(bare >= 0.5, sampling=sizes.tolist())
        gone = (inside <= blemishes.cut_mm) & _patches(bare.shape, sizes, blemishes.cut, rng)
        found = {name: np.where(gone, 0.0, part) for name, part in found.items()}
    return found


def _replaced(fractions: Fractions, tissue: str, share: Float[Array, "X Y Z"]) -> Fractions:
    """The fractions after ``share`` of every voxel has become one tissue."""
    return {name: part * (1 - share) + (share if name == tissue else 0) for name, part in fractions.items()}


def _patches(shape: tuple[int, ...], sizes: Float[Array, " 3"], share: float, rng: np.random.Generator) -> Array:
    """A random part of space, with a share of about ``share``."""
    field = smooth_noise(shape, _PATCH_MM / sizes, rng)
    return field > np.quantile(field, 1 - share)


# White matter right below the cortex, which has less myelin than deep white matter and is darker in a T1.

#: Standard deviation of the Gaussian along which the gradient decays.
GRADIENT_MM = 1.0


def share_near_grey(
    white: Float[Array, "X Y Z"], grey: Float[Array, "X Y Z"], sizes: Float[Array, " 3"]
) -> Float[Array, "X Y Z"]:
    """The white matter of every voxel, weighted by its nearness to grey matter: 1 at a flat border, 0 in the depth."""
    # At a flat border half of the surroundings are grey matter.
    return white * np.minimum(2 * scipy.ndimage.gaussian_filter(grey, GRADIENT_MM / sizes), 1)


# Structures of a head other than its cortex, as ellipsoids: ventricles, deep grey matter, cerebellum, brainstem.
#
# They are deliberately simple and not realistic. They make the inside of the white surface as inhomogeneous as in a
# scan, and give the registration structures below the cerebrum.

#: Smallest distance between a structure inside the white surface and this surface, in mm.
DEPTH_MM = 3.0
# Centres: from the midline outwards, from posterior to anterior, from inferior to superior, as fractions of the
# bounding box of one white surface. Half axes as fractions of the same lengths. Measured by eye on MNI152.
_PLACES = {
    "thalamus": ((0.18, 0.50, 0.43), (0.120, 0.083, 0.067)),
    "caudate": ((0.20, 0.68, 0.445), (0.075, 0.054, 0.067)),
    "putamen": ((0.41, 0.63, 0.378), (0.080, 0.090, 0.075)),
    "ventricle": ((0.17, 0.58, 0.51), (0.067, 0.155, 0.050)),
    "posterior horn": ((0.38, 0.36, 0.436), (0.075, 0.077, 0.058)),
    "cerebellum": ((0.36, 0.24, 0.07), (0.370, 0.130, 0.140)),
    "brainstem": ((0.0, 0.444, 0.05), (0.165, 0.065, 0.217)),
}
_VENTRICLES, _BELOW = ("ventricle", "posterior horn"), ("cerebellum", "brainstem")


@dataclasses.dataclass(frozen=True, eq=False)
class Structure:
    """An ellipsoid of tissue."""

    tissue: str  # "deep grey", "fluid" or "hindbrain"
    centre_mm: Float[Array, " 3"]  # in head coordinates
    axes_mm: Float[Array, "3 3"]  # the half axes, as columns
    inside_white: bool  # it is cut off at the depth DEPTH_MM; if not, it is cut off at the pial surfaces, outside them


def structures_of(white: Mapping[str, Mesh], ventricles: float = 1.0, below: float = 1.0) -> list[Structure]:
    """The structures scaled to the bounding boxes of the two white surfaces, in the order in which they are added."""
    if not (0 <= ventricles <= 3 and 0 <= below <= 3):
        raise ValueError(f"ventricles is {ventricles} and below {below}; multiples from 0 (none) to 3 are needed")
    found = []
    for name, (place, half) in _PLACES.items():
        scale = ventricles if name in _VENTRICLES else below if name in _BELOW else 1.0
        for side, mesh in white.items():
            low, high = (getattr(mesh.vertices.detach(), end)(dim=0).values.double().numpy() for end in ("min", "max"))
            length, place_in_box = high - low, np.array(place)
            if side == "left":
                place_in_box = place_in_box * [-1, 1, 1] + [1, 0, 0]
            centre = low + length * place_in_box
            tissue = "fluid" if name in _VENTRICLES else "hindbrain" if name in _BELOW else "deep grey"
            found.append(Structure(tissue, centre, np.diag(scale * length * half), name not in _BELOW))
    return [s for s in found if np.linalg.det(s.axes_mm) > 0]


@dataclasses.dataclass(frozen=True, eq=False)
class Ellipsoids:
    """Simple structures as the inside of a head, see :class:`meshot.synth.imaging.Interior`."""

    structures: Sequence[Structure]  # in the order in which they are added

    def ends(self) -> Float[Tensor, "n 3"]:
        """The ends of all half axes, in mm."""
        ends = [s.centre_mm + sign * s.axes_mm.T[k] for s in self.structures for sign in (-1, 1) for k in range(3)]
        return torch.from_numpy(np.array(ends).reshape(-1, 3))

    def added_to(
        self, fractions: Mapping[str, Float[Array, "X Y Z"]], inside_pial: Float[Array, "X Y Z"], grid: Volume
    ) -> dict[str, Float[Array, "X Y Z"]]:
        """Tissue fractions with the structures: see :func:`meshot.synth.imaging.add_structures`."""
        return add_structures(fractions, inside_pial, grid, self.structures)


def moved_structure(structure: Structure, affine: Float[Array, "4 4"]) -> Structure:
    """A structure after an affine transform of the whole head."""
    centre = affine[:3, :3] @ structure.centre_mm + affine[:3, 3]
    return dataclasses.replace(structure, centre_mm=centre, axes_mm=affine[:3, :3] @ structure.axes_mm)


def structure_fraction(structure: Structure, grid: Volume) -> tuple[tuple[slice, ...], Float[Array, "x y z"]]:
    """The approximate fraction of each voxel that an ellipsoid fills, in a box of the grid, and the slices of the box.

    The edge is a linear ramp one voxel wide, accurate to a few per cent for ellipsoids that are many voxels thick.
    """
    reach = np.linalg.norm(np.linalg.inv(grid.affine)[:3, :3] @ structure.axes_mm, axis=1)
    centre = mm_to_voxel(grid, torch.from_numpy(structure.centre_mm[None])).numpy()[0]
    low = np.clip(np.floor(centre - reach).astype(int) - 1, 0, grid.data.shape)
    high = np.clip(np.ceil(centre + reach).astype(int) + 2, low, grid.data.shape)
    box = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
    places = np.stack(np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high)), indexing="ij"), axis=-1) - centre
    unit = places @ (np.linalg.inv(structure.axes_mm) @ grid.affine[:3, :3]).T
    radius = np.sqrt((unit**2).sum(axis=-1))
    thickness = np.cbrt(np.linalg.det(structure.axes_mm)) / voxel_sizes(grid).mean()
    return box, np.clip(0.5 + (1 - radius) * abs(thickness), 0, 1)


def add_structures(
    fractions: Mapping[str, Float[Array, "X Y Z"]],
    inside_pial: Float[Array, "X Y Z"],
    grid: Volume,
    structures: Sequence[Structure],
) -> dict[str, Float[Array, "X Y Z"]]:
    """Tissue fractions after structures have replaced other tissue, one after another."""
    empty = {tissue: np.zeros(grid.data.shape) for tissue in ("deep grey", "hindbrain", "fluid")}
    fractions = {tissue: values.copy() for tissue, values in fractions.items()} | empty
    depth = white_depth(fractions["white"], voxel_sizes(grid)) if any(s.inside_white for s in structures) else None
    for structure in structures:
        box, part = structure_fraction(structure, grid)
        if structure.inside_white:
            part = part * np.clip(0.5 + (depth[box] - DEPTH_MM) / voxel_sizes(grid).mean(), 0, 1)
        else:
            part = part * (1 - inside_pial[box])
        for tissue, values in fractions.items():
            values[box] += part * ((tissue == structure.tissue) - values[box])
    return fractions


def white_depth(white: Float[Array, "X Y Z"], sizes: Float[Array, " 3"]) -> Float[Array, "X Y Z"]:
    """The depth of each voxel inside white matter, in mm, accurate to about a voxel."""
    inside = white > 0.5
    depth = np.zeros(white.shape)
    found = scipy.ndimage.find_objects(inside.astype(np.uint8))
    if found and found[0] is not None:
        box = tuple(slice(max(s.start - 1, 0), s.stop + 1) for s in found[0])
        depth[box] = scipy.ndimage.distance_transform_edt(inside[box], sampling=sizes.tolist())
    return depth
