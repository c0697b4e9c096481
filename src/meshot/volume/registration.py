"""Affine registration of one image to another, by mutual information."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from meshot.extras import needing
from meshot.types import Array, Float, Tensor
from meshot.volume.volume import Volume, resample, transform_points, voxel_sizes

with needing("cortex"):
    import SimpleITK

#: ITK counts x and y the other way (LPS); the matrix is its own inverse.
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
#: Blocks of voxels along each axis that ITK needs to smooth an image.
_FEWEST_BLOCKS = 4


@dataclasses.dataclass(frozen=True)
class _Search:
    """How much work a registration does."""

    voxels_mm: tuple[float, ...]  # the voxels of the levels, coarse to fine
    averaged_mm: float  # both images are first averaged over blocks, to voxels of about this size; 0: they are not
    shares: tuple[float, ...]  # which part of the voxels of a level is looked at
    smoothing_mm: tuple[float, ...]  # standard deviation of the smoothing of a level
    n_iterations: int  # the most steps of a level
    shortest_step_mm: float  # below this length of a step a level ends


#: 18 to 30 s a scan.
THOROUGH = _Search((4.0, 2.0), 0.0, (0.5, 0.15), (2.0, 1.0), 150, 1e-3)
#: 2 to 5 s a scan. Points of the brain differ from those of the thorough search by a few tenths of a millimetre.
QUICK = _Search((6.0, 3.0), 3.0, (1.0, 0.3), (4.0, 2.0), 60, 2e-2)


def register_affine(moving: Volume, fixed: Volume, seed: int = 0, quick: bool = False) -> Float[Array, "4 4"]:
    """The affine that takes scanner RAS of ``moving`` to scanner RAS of ``fixed``, in mm: the images then agree.

    Centres of mass first, then a rigid and then an affine transform, each from coarse to fine, by gradient descent on
    Mattes' mutual information, which does not ask that intensities be the same.

    Parameters
    ----------
    moving, fixed : Volume
        Images of the same organ. Contrast, grid and position may differ. The centres of mass are aligned first. The
        orientations may differ by about 30 degrees.
    seed : int
        Seed of the sampled voxels. The same seed gives the same result.
    quick : bool
        Whether to look at voxels of 6 and 3 mm (some 4 s) instead of 4 and 2 mm (some 20 s).

    Raises
    ------
    ValueError
        If one of the images is constant or has too few voxels along an axis, or the search leaves no overlap.

    References
    ----------
    Mattes et al., *PET-CT image registration in the chest using free-form deformations*, IEEE TMI 2003.
    """
    found = _registered(moving, fixed, seed, QUICK if quick else THOROUGH, _rigid_then_affine)
    # ITK's transform takes points of the fixed image to the moving one.
    return np.linalg.inv(LPS @ _as_matrix(found) @ LPS)


def register_rigid(moving: Volume, fixed: Volume, seed: int = 0) -> Float[Array, "4 4"]:
    """The rotation and translation that take scanner RAS of ``moving`` to scanner RAS of ``fixed``, in mm."""
    # For two scans of one person: the head is rigid. Otherwise as :func:`register_affine`.
    found = _registered(moving, fixed, seed, THOROUGH, _rigid)
    return np.linalg.inv(LPS @ _as_matrix(found) @ LPS)


def _registered(moving: Volume, fixed: Volume, seed: int, search: _Search, find: Callable) -> SimpleITK.Transform:
    moving, fixed = with_dark_background(moving), with_dark_background(fixed)
    _require_contrast(moving, "moving")
    _require_contrast(fixed, "fixed")
    for volume, name in ((moving, "moving"), (fixed, "fixed")):
        blocks = np.array(volume.data.shape) // _block_shape(voxel_sizes(volume), search.averaged_mm)
        if blocks.min() < _FEWEST_BLOCKS:
            extent = " × ".join(f"{length:.3g}" for length in volume.data.shape * voxel_sizes(volume))
            raise ValueError(
                f"the {name} image has {' × '.join(map(str, volume.data.shape))} voxels and spans {extent} mm: it is "
                "too thin to be registered; give the image of a whole head"
            )
    images = []
    for volume in (fixed, moving):
        # A grid whose axes are not orthogonal is refused by ITK, and none comes from a scanner.
        image = SimpleITK.GetImageFromArray(np.ascontiguousarray(volume.data.astype(np.float32).transpose(2, 1, 0)))
        sizes, in_lps = voxel_sizes(volume), LPS @ volume.affine
        image.SetSpacing(sizes.tolist())
        image.SetOrigin(in_lps[:3, 3].tolist())
        image.SetDirection((in_lps[:3, :3] / sizes).ravel().tolist())
        # The means of blocks of about this size.
        images.append(SimpleITK.BinShrink(image, _block_shape(image.GetSpacing(), search.averaged_mm)))
    # Sums in a fixed order, so that the result repeats; ITK's number of threads is global.
    before = SimpleITK.ProcessObject.GetGlobalDefaultNumberOfThreads()
    SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(1)
    try:
        return find(*images, seed, search)
    finally:
        SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(before)


def _rigid(fixed: SimpleITK.Image, moving: SimpleITK.Image, seed: int, search: _Search) -> SimpleITK.Euler3DTransform:
    start = SimpleITK.CenteredTransformInitializer(
        fixed, moving, SimpleITK.Euler3DTransform(), SimpleITK.CenteredTransformInitializerFilter.MOMENTS
    )
    return SimpleITK.Euler3DTransform(_found(fixed, moving, start, seed, search).GetNthTransform(0))


def _rigid_then_affine(
    fixed: SimpleITK.Image, moving: SimpleITK.Image, seed: int, search: _Search
) -> SimpleITK.AffineTransform:
    rigid = _rigid(fixed, moving, seed, search)
    affine = SimpleITK.AffineTransform(3)
    affine.SetCenter(rigid.GetCenter())
    affine.SetMatrix(rigid.GetMatrix())
    affine.SetTranslation(rigid.GetTranslation())
    return SimpleITK.AffineTransform(_found(fixed, moving, affine, seed, search).GetNthTransform(0))


def _found(
    fixed: SimpleITK.Image, moving: SimpleITK.Image, start: SimpleITK.Transform, seed: int, search: _Search
) -> SimpleITK.CompositeTransform:
    method = SimpleITK.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(numberOfHistogramBins=32)
    method.SetMetricSamplingStrategy(method.RANDOM)
    method.SetMetricSamplingPercentagePerLevel(search.shares, seed=seed + 1)  # 0 would mean the time of day
    method.SetInterpolator(SimpleITK.sitkLinear)
    spacing = min(fixed.GetSpacing())
    method.SetShrinkFactorsPerLevel([max(1, round(target / spacing)) for target in search.voxels_mm])
    method.SetSmoothingSigmasPerLevel(search.smoothing_mm)
    method.SmoothingSigmasAreSpecifiedInPhysicalUnitsOn()
    method.SetOptimizerAsRegularStepGradientDescent(
        learningRate=2.0, minStep=search.shortest_step_mm, numberOfIterations=search.n_iterations, relaxationFactor=0.6
    )
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetInitialTransform(start, inPlace=False)
    try:
        return SimpleITK.CompositeTransform(method.Execute(fixed, moving))
    except RuntimeError as error:
        raise ValueError(
            f"registration failed ({str(error).strip().splitlines()[-1]}): do both images show the same organ?"
        ) from error


def _block_shape(sizes: Iterable[float], voxels_mm: float) -> list[int]:
    """How many voxels of these sizes make a block of about this size, along each axis."""
    return [max(1, round(voxels_mm / size)) for size in sizes]


def _as_matrix(transform: SimpleITK.AffineTransform | SimpleITK.Euler3DTransform) -> Float[Array, "4 4"]:
    """x ↦ A (x − c) + c + t as one matrix."""
    matrix, centre = np.array(transform.GetMatrix()).reshape(3, 3), np.array(transform.GetCenter())
    result = np.eye(4)
    result[:3, :3] = matrix
    result[:3, 3] = np.array(transform.GetTranslation()) + centre - matrix @ centre
    return result


#: Parts of the range of values: a background so far above the lowest value is lowered, a value so far alone is filled.
_RAISED, _ALONE = 0.1, 0.25


def with_dark_background(volume: Volume) -> Volume:
    """The volume with its background at its lowest value, as moments and the scaling to [0, 1] need it.

    Two kinds of scan have it elsewhere. If intensities were standardised inside the head, the background is 0 and dark
    tissue lies below: the value of most voxels on the border of the grid becomes the lowest. If a filling value such as
    −1024 lies far below all others and is not the background, or is negative while no other value is, it becomes the
    lowest of the others. All other volumes are returned as they are.
    """
    data = volume.data
    lowest = data.min()
    others = data[data > lowest]
    if not len(others):
        return volume
    second, top = others.min(), np.percentile(others[:: 1 + len(others) // 100_000], 99.9)
    faces = [np.take(data, place, axis).ravel() for axis in range(3) for place in (0, -1)]
    values, counts = np.unique(np.concatenate(faces), return_counts=True)
    background = values[counts.argmax()]
    alone = second - lowest > _ALONE * (top - second)
    if alone and (background != lowest or lowest < 0 <= second):
        data, lowest = np.where(data == lowest, second, data), second
        background = max(background, second)
    if 2 * counts.max() > counts.sum() and background - lowest > _RAISED * (top - background):
        data = np.where(data == background, lowest, data)
    return volume if data is volume.data else volume.with_data(data)


def _require_contrast(volume: Volume, name: str) -> None:
    if volume.data.min() == volume.data.max():
        raise ValueError(f"the {name} image is {volume.data.flat[0]} everywhere: there is nothing to register")


# The standard grid of the paper: scans in MNI152 space, on one grid, with values in [0, 1].

#: The extent of the grid in mm (crop or pad to as many voxels of 1 mm), and its shape: voxels of 1.5 × 1.444 × 1.5 mm.
EXTENT_MM = (192, 208, 192)
SHAPE = (128, 144, 128)


@dataclasses.dataclass(frozen=True, eq=False)
class StandardScan:
    """A scan on the standard grid, with its transform to and from scanner space.

    Parameters
    ----------
    volume : Volume
        128 × 144 × 128 voxels, values in [0, 1]; its affine leads to MNI152 space, in mm.
    to_standard : array
        4 × 4; takes scanner RAS of the original scan to MNI152 space, in mm.
    """

    volume: Volume
    to_standard: Float[Array, "4 4"]

    def to_scanner(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Points of MNI152 space in scanner RAS of the original scan, in mm."""
        return transform_points(np.linalg.inv(self.to_standard), points)

    def from_scanner(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Points in scanner RAS of the original scan in MNI152 space, in mm."""
        return transform_points(self.to_standard, points)


def standard_scan(scan: Volume, template: Volume, seed: int = 0, quick: bool = False) -> StandardScan:
    """Prepare a scan for the networks: affine registration, cropping or padding, resampling, scaling to [0, 1].

    Parameters
    ----------
    scan : Volume
        In any orientation and voxel size.
    template : Volume
        Where to register to: the MNI152 average, see ``meshot.anatomy.templates``.
    seed : int
        Of the registration.
    quick : bool
        As in :func:`meshot.volume.register_affine`.

    Raises
    ------
    ValueError
        As :func:`meshot.volume.register_affine`.

    Notes
    -----
    The three steps use one trilinear interpolation, because each interpolation blurs. Values are scaled by the extremes
    on the grid, after :func:`meshot.volume.with_dark_background`. Outside the scan its minimum is used.

    References
    ----------
    Le et al., ICLR 2024, appendix (preprocessing).
    """
    # Rounded, because the last bits differ between CPUs. This moves no point by as much as 1e-3 mm.
    to_standard = register_affine(scan, template, seed, quick).round(6)
    return place_on_grid(scan, to_standard, centre_of_mass(template))


def place_on_grid(scan: Volume, to_standard: Float[Array, "4 4"], centre_mm: Float[Array, " 3"]) -> StandardScan:
    """A scan on the standard grid around a centre, by a known affine from scanner RAS to that space, in mm."""
    # The box of the grid, from the outer sides of its voxels, lies around the centre.
    sizes = np.divide(EXTENT_MM, SHAPE)
    affine = np.diag([*sizes, 1.0])
    affine[:3, 3] = centre_mm - sizes * (np.array(SHAPE) - 1) / 2
    scan = with_dark_background(scan)
    on_grid = resample(scan, SHAPE, affine, np.linalg.inv(to_standard), outside="lowest")
    low, high = on_grid.data.min(), on_grid.data.max()
    if low == high:
        raise ValueError(f"the scan is {low} all over the standard grid: is it in the place that its affine says?")
    scaled = on_grid.with_data((on_grid.data - low) / (high - low))
    return StandardScan(scaled, np.asarray(to_standard, dtype=np.float64))


def centre_of_mass(volume: Volume) -> Float[Array, " 3"]:
    """The centre of the values above the smallest, in mm; the standard grid lies around that of its template.

    Raises
    ------
    ValueError
        If the volume is constant.
    """
    weights = volume.data.astype(np.float64) - volume.data.min()
    if not weights.any():
        raise ValueError(f"the volume is {volume.data.min()} everywhere and has no centre; one with an image is needed")
    axes = [
        np.tensordot(weights.sum(axis=tuple({0, 1, 2} - {k})), np.arange(n), 1) for k, n in enumerate(weights.shape)
    ]
    return volume.affine[:3, :3] @ (np.array(axes) / weights.sum()) + volume.affine[:3, 3]


# The average of several scans of one person, which has less noise than one.

#: Inside the head. Simulated repeats with noise of 8 % of the largest value reach .99, inverted contrast reaches .1.
LOWEST_CORRELATION = 0.8


def averaged_scan(scans: Sequence[Volume], names: Sequence[str] | None = None) -> Volume:
    """The mean of several scans of one head on the grid of the first, after rigid registration to the first.

    Each scan is scaled so that it differs least from the first in the mean square, and is interpolated once with cubic
    splines. A voxel that some scans do not cover is the mean of the others. The scans are of one person, with the same
    contrast; grids and positions may differ. Errors call the scans by their ``names``.

    Raises
    ------
    ValueError
        If there is no scan, one is constant, or one does not agree with the first after registration.
    """
    if not scans:
        raise ValueError("there is no scan; at least one is needed")
    names = [f"scan {i + 1}" for i in range(len(scans))] if names is None else names
    first = scans[0].data.astype(np.float64)
    total, covered = first.copy(), np.ones(first.shape)
    for scan, name in zip(scans[1:], names[1:], strict=True):
        # The scan at the voxels of the first one, and where it covers them.
        onto = scans[0].data.shape, scans[0].affine, np.linalg.inv(register_rigid(scan, scans[0]))
        inside = resample(scan.with_data(np.ones(scan.data.shape)), *onto).data > 0.999
        moved = resample(scan, *onto, order=3).data
        # The correlation of both inside the head, after smoothing by one voxel, which removes most noise.
        smooth = [gaussian_filter(image, 1.0) for image in (moved, first)]
        head = inside & (smooth[1] > smooth[1].mean())
        agreement = float(np.corrcoef(smooth[0][head], smooth[1][head])[0, 1]) if head.any() else 0.0
        if not agreement >= LOWEST_CORRELATION:
            raise ValueError(
                f"{name} and {names[0]} agree poorly after registration (correlation {agreement:.2f}; "
                f"{LOWEST_CORRELATION} is needed): do both show the same head with the same contrast? Choose one"
            )
        scale = float(moved[inside] @ first[inside]) / float(moved[inside] @ moved[inside])
        total[inside] += scale * moved[inside]
        covered += inside
    return scans[0].with_data((total / covered).astype(np.float32))
