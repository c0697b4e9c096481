"""Images of several scales in one tensor, from which all cubes around points are cut at once."""

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot.volume import Volume


class StackedImages:
    """Images of several scales on one device, each with a border of zeros, one after the other in a flat tensor.

    A cube around a point needs the voxels at whole distances from it, each interpolated with the same weights. So the
    (size + 1)³ voxels around are taken once. Interpolation and convolution are both linear. The convolution comes first
    (:meth:`meshot.model.cubes.CubeConvolution.cut`), as one matrix product: interpolated cubes are never stored.

    Parameters
    ----------
    images : sequence of Volume
    size : int
        Number of voxels along each side of a cube.
    like : tensor
        Its dtype and device are used.
    """

    def __init__(self, images: tuple[Volume, ...], size: int, like: Tensor):
        half = size // 2
        self.size, self.margin = size, half + 1
        padded = [np.pad(image.data, self.margin + half) for image in images]
        self.values = torch.cat([torch.from_numpy(np.ascontiguousarray(each)).to(like).flatten() for each in padded])
        shapes = np.array([each.shape for each in padded])
        strides = np.stack([shapes[:, 1] * shapes[:, 2], shapes[:, 2], np.ones(len(images), np.int64)], axis=1)
        starts = np.cumsum([0, *(each.size for each in padded)])[:-1]
        around = np.array(list(np.ndindex(*[size + 1] * 3)))
        self.starts = torch.from_numpy(starts)[:, None].to(like.device)  # (scales, 1)
        self.strides = torch.from_numpy(strides)[:, None].to(like.device)  # (scales, 1, 3)
        self.around = torch.from_numpy(strides @ around.T)[:, None].to(like.device)  # (scales, 1, (size + 1)³)
        #: The last place whose cubes are inside; a cube there has no voxel of the image.
        self.last = torch.from_numpy(shapes - 2 * half - 1)[:, None].to(like)
        to_voxels = np.stack([np.linalg.inv(image.affine) for image in images])
        self.turn = torch.from_numpy(to_voxels[:, :3, :3].transpose(0, 2, 1).copy()).to(like)
        self.shift = torch.from_numpy(to_voxels[:, None, :3, 3] + self.margin).to(like)

    def corners(
        self, points: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "scales n voxels"], Float[Tensor, "scales n 8"]]:
        """The voxels around points in mm, zero outside the image, and the weights of the eight cubes among them.

        A cube around a point is the weighted sum of the eight cubes of (size)³ voxels that begin at the corners of the
        first voxel, in the order of ``np.ndindex(2, 2, 2)``. The weights are those of trilinear
        interpolation, and differentiable in the points.
        """
        # Distant points are clipped to the border, where all cubes are zero.
        places = torch.minimum((points @ self.turn + self.shift).clamp(min=0), self.last)
        lower = torch.minimum(places.detach().nan_to_num().floor(), self.last - 1)
        shares = torch.stack([lower + 1 - places, places - lower], dim=3)  # (scales, n, 3, 2)
        x, y, z = shares.unbind(dim=2)
        weights = x[..., :, None, None] * y[..., None, :, None] * z[..., None, None, :]
        first = (lower.long() * self.strides).sum(dim=2) + self.starts
        return self.values[first[..., None] + self.around], weights.flatten(2)
