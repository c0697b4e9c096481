"""Affine registration of one image to another, by mutual information."""

import contextlib
from collections.abc import Iterator

import numpy as np

from meshot.extras import needing
from meshot.types import Array, Float
from meshot.volume.volume import Volume, voxel_sizes

with needing("cortex"):
    import SimpleITK

#: ITK counts x and y the other way (LPS); the matrix is its own inverse.
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


def register_affine(moving: Volume, fixed: Volume, seed: int = 0) -> Float[Array, "4 4"]:
    """The affine that takes scanner RAS of ``moving`` to scanner RAS of ``fixed``, in mm: the images then agree.

    Centres of mass first, then a rigid and then an affine transform, each from coarse to fine (voxels of 4 mm, then
    2 mm), by gradient descent on Mattes' mutual information, which does not ask that intensities be the same.

    Parameters
    ----------
    moving, fixed : Volume
        Images of the same organ; contrast, grid and position may differ. Far-off positions are met by the centres of
        mass; the orientations may differ by some 30 degrees.
    seed : int
        Of the voxels that are looked at. With the same seed the result is the same.

    Raises
    ------
    ValueError
        If one of the images is constant, or the search leaves no overlap.

    References
    ----------
    Mattes et al., *PET-CT image registration in the chest using free-form deformations*, IEEE TMI 2003.
    """
    _require_contrast(moving, "moving")
    _require_contrast(fixed, "fixed")
    images = _as_image(fixed), _as_image(moving)
    with _one_thread():
        found = _rigid_then_affine(*images, seed)
    # ITK's transform takes points of the fixed image to the moving one.
    return np.linalg.inv(LPS @ _as_matrix(found) @ LPS)


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Sums in a fixed order, so that the result repeats; ITK's number of threads is global."""
    before = SimpleITK.ProcessObject.GetGlobalDefaultNumberOfThreads()
    SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(1)
    try:
        yield
    finally:
        SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(before)


def _rigid_then_affine(fixed: SimpleITK.Image, moving: SimpleITK.Image, seed: int) -> SimpleITK.AffineTransform:
    start = SimpleITK.CenteredTransformInitializer(
        fixed, moving, SimpleITK.Euler3DTransform(), SimpleITK.CenteredTransformInitializerFilter.MOMENTS
    )
    rigid = SimpleITK.Euler3DTransform(_search(fixed, moving, start, seed).GetNthTransform(0))
    affine = SimpleITK.AffineTransform(3)
    affine.SetCenter(rigid.GetCenter())
    affine.SetMatrix(rigid.GetMatrix())
    affine.SetTranslation(rigid.GetTranslation())
    return SimpleITK.AffineTransform(_search(fixed, moving, affine, seed).GetNthTransform(0))


def _search(
    fixed: SimpleITK.Image, moving: SimpleITK.Image, start: SimpleITK.Transform, seed: int
) -> SimpleITK.CompositeTransform:
    method = SimpleITK.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(numberOfHistogramBins=32)
    method.SetMetricSamplingStrategy(method.RANDOM)
    method.SetMetricSamplingPercentagePerLevel([0.5, 0.15], seed=seed + 1)  # 0 would mean the time of day
    method.SetInterpolator(SimpleITK.sitkLinear)
    method.SetShrinkFactorsPerLevel(_shrink_factors(fixed))
    method.SetSmoothingSigmasPerLevel([2.0, 1.0])
    method.SmoothingSigmasAreSpecifiedInPhysicalUnitsOn()
    method.SetOptimizerAsRegularStepGradientDescent(
        learningRate=2.0, minStep=1e-3, numberOfIterations=150, relaxationFactor=0.6
    )
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetInitialTransform(start, inPlace=False)
    try:
        return SimpleITK.CompositeTransform(method.Execute(fixed, moving))
    except RuntimeError as error:
        raise ValueError(
            f"registration failed ({str(error).strip().splitlines()[-1]}): do both images show the same organ?"
        ) from error


def _shrink_factors(image: SimpleITK.Image) -> list[int]:
    spacing = min(image.GetSpacing())
    return [max(1, round(target / spacing)) for target in (4.0, 2.0)]


def _as_image(volume: Volume) -> SimpleITK.Image:
    """The volume for ITK; a grid whose axes are not orthogonal is refused by ITK, and none comes from a scanner."""
    image = SimpleITK.GetImageFromArray(np.ascontiguousarray(volume.data.astype(np.float32).transpose(2, 1, 0)))
    sizes = voxel_sizes(volume)
    in_lps = LPS @ volume.affine
    image.SetSpacing(sizes.tolist())
    image.SetOrigin(in_lps[:3, 3].tolist())
    image.SetDirection((in_lps[:3, :3] / sizes).ravel().tolist())
    return image


def _as_matrix(transform: SimpleITK.AffineTransform) -> Float[Array, "4 4"]:
    """x ↦ A (x − c) + c + t as one matrix."""
    matrix, centre = np.array(transform.GetMatrix()).reshape(3, 3), np.array(transform.GetCenter())
    result = np.eye(4)
    result[:3, :3] = matrix
    result[:3, 3] = np.array(transform.GetTranslation()) + centre - matrix @ centre
    return result


def _require_contrast(volume: Volume, name: str) -> None:
    if volume.data.min() == volume.data.max():
        raise ValueError(f"the {name} image is {volume.data.flat[0]} everywhere: there is nothing to register")
