"""Gradients of myelin on both sides of the white surface, which soften its step in a T1."""

import numpy as np
import scipy.ndimage

from meshot.types import Array, Float

#: Standard deviation of the Gaussian along which the gradients decay.
GRADIENT_MM = 1.0


def myelin_gradients(
    white: Float[Array, "X Y Z"], grey: Float[Array, "X Y Z"], of_grey: float, of_white: float,
    sizes: Float[Array, " 3"],
) -> Float[Array, "X Y Z"]:  # fmt: skip
    """The change of the signal, relative to the difference between white and grey matter.

    The deep layers of the cortex have more myelin than the others, and white matter below the cortex has less than deep
    white matter.

    Parameters
    ----------
    white, grey : array
        The fractions of every voxel.
    of_grey, of_white : float
        The changes at a flat border, in [0, 1].
    sizes : array
        Of the voxels, in mm.
    """
    # At a flat border half of the surroundings belong to either tissue.
    beside_white, beside_grey = (
        np.minimum(2 * scipy.ndimage.gaussian_filter(part, GRADIENT_MM / sizes), 1) for part in (white, grey)
    )
    return of_grey * grey * beside_white - of_white * white * beside_grey
