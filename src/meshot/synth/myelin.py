"""White matter right below the cortex, which has less myelin than deep white matter and is darker in a T1."""

import numpy as np
import scipy.ndimage

from meshot.types import Array, Float

#: Standard deviation of the Gaussian along which the gradient decays.
GRADIENT_MM = 1.0


def share_near_grey(
    white: Float[Array, "X Y Z"], grey: Float[Array, "X Y Z"], sizes: Float[Array, " 3"]
) -> Float[Array, "X Y Z"]:
    """The white matter of every voxel, weighted by its nearness to grey matter: 1 at a flat border, 0 in the depth.

    Parameters
    ----------
    white, grey : array
        The fractions of every voxel.
    sizes : array
        Of the voxels, in mm.
    """
    # At a flat border half of the surroundings are grey matter.
    return white * np.minimum(2 * scipy.ndimage.gaussian_filter(grey, GRADIENT_MM / sizes), 1)
