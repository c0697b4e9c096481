"""Image features computed only at the voxels near points, each once, on first use."""

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from meshot.model import _kernel_visited as kernel
from meshot.model.cubes import CubeConvolution
from meshot.types import Array, Float, Int64, Tensor
from meshot.volume import Volume, mm_to_voxel


class VisitedFeatures:
    """The features of :meth:`meshot.model.cubes.CubeConvolution.at`, convolved only at visited voxels.

    A surface is near only about a tenth of the voxels in its bounding box. Rows of features for all scales are kept in
    one table, so that each voxel is convolved once. Runs on a CPU. Only first derivatives are available.

    Parameters
    ----------
    cubes : CubeConvolution
    images : tuple of Volume
        One per scale, see :meth:`meshot.model.cubes.CubeConvolution.images`.
    """

    def __init__(self, cubes: CubeConvolution, images: tuple[Volume, ...]):
        self.cubes = cubes
        self.levels = [_Level(image, cubes.weight.shape[-1], cubes.weight) for image in images]
        self.rows = _Rows(cubes.weight)
        self.values = cubes.weight.new_zeros((0, cubes.weight.shape[0]))

    def at(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n features"]:
        """Features at points in mm, by trilinear interpolation, zero outside the image. Differentiable."""
        places = [level.places(points) for level in self.levels]
        found, self.values = _Interpolated.apply(self, self.cubes.weight, self.values, *places)
        return self.cubes.bias + found


class _Level:
    """One scale: the image, padded so that every overlapping cube is inside, and the row of every visited voxel."""

    def __init__(self, image: Volume, size: int, like: Tensor):
        half = size // 2
        self.image, self.size, self.margin = image, size, half + 1
        self.shape = tuple(n + 2 * self.margin for n in image.data.shape)
        self.padded = np.pad(image.data, self.margin + half).astype(_numpy_dtype(like))
        self.row_of = np.full(np.prod(self.shape), -1, np.int32)

    def places(self, points: Tensor) -> Tensor:
        """Points in voxels of the padded grid. Those outside are clipped to its border, where features are zero."""
        last = points.new_tensor(self.shape) - 1
        return torch.minimum((mm_to_voxel(self.image, points) + self.margin).clamp(min=0), last)

    def cubes(self, voxels: Int64[Array, " k"]) -> Float[Array, "k cube"]:
        """The cubes of values around the given voxels."""
        cubes = np.empty((len(voxels), self.size**3), self.padded.dtype)
        kernel.cut_cubes(self.padded, voxels, self.shape, self.size, cubes)
        return cubes


class _Rows:
    """A growing buffer for rows of features, so that appending rarely copies."""

    def __init__(self, like: Tensor):
        self.room = like.detach().new_empty((0, like.shape[0]))

    def with_rows(self, n_rows: int) -> Tensor:
        """The first ``n_rows`` rows. Rows written before are kept."""
        if n_rows > len(self.room):
            larger = self.room.new_empty((max(n_rows, 3 * len(self.room) // 2), self.room.shape[1]))
            larger[: len(self.room)] = self.room
            self.room = larger
        return self.room[:n_rows]


class _Interpolated(torch.autograd.Function):
    """Features at positions on every level, and the table of rows including the new ones.

    The table is passed from call to call, and its gradient in the opposite order. Each call adds its own gradient to
    it, uses the part of the rows that it made for the gradient of the weight, and passes on the rest.
    """

    @staticmethod
    def forward(ctx, features, weight, before, *places):
        ctx.set_materialize_grads(False)
        ctx.levels, ctx.made, n_rows = features.levels, [], len(before)
        kernels = weight.detach().flatten(2)  # (features, scales, size³)
        # A position with NaN has no voxel. It is looked up at the first voxel, and its features are set to NaN.
        lost = torch.stack([place.detach().isnan().any(dim=1) for place in places]).any(dim=0)
        arrays = [np.ascontiguousarray(place.detach().nan_to_num().numpy()) for place in places]
        for scale, (level, array) in enumerate(zip(features.levels, arrays, strict=True)):
            new = kernel.visit(array, level.shape, level.row_of, n_rows)
            cubes = torch.from_numpy(level.cubes(new))
            table = features.rows.with_rows(n_rows + len(new))
            torch.mm(cubes, kernels[:, scale].T, out=table[n_rows:])
            ctx.made.append((slice(n_rows, n_rows + len(new)), cubes))
            n_rows += len(new)
        found = weight.new_zeros((len(arrays[0]), weight.shape[0]))
        for level, array in zip(features.levels, arrays, strict=True):
            kernel.interpolate(array, level.shape, level.row_of, table.numpy(), found.numpy())
        found[lost] = torch.nan
        # Keeping an output itself would keep the graph, and all its memory, alive.
        ctx.arrays, ctx.table, ctx.n_before, ctx.weight_shape = arrays, table.detach(), len(before), weight.shape
        return found, table

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output, table_gradient):
        if table_gradient is None:
            table_gradient = torch.zeros_like(ctx.table)
        place_gradients = [np.zeros_like(array) for array in ctx.arrays]
        if grad_output is not None:
            given, into, values = grad_output.contiguous().numpy(), table_gradient.numpy(), ctx.table.numpy()
            for level, array, place_gradient in zip(ctx.levels, ctx.arrays, place_gradients, strict=True):
                kernel.carry_back(array, level.shape, level.row_of, values, given, into, place_gradient)
        weight_gradient = torch.stack([table_gradient[rows].T @ cubes for rows, cubes in ctx.made], dim=1)
        return (
            None,
            weight_gradient.view(ctx.weight_shape),
            table_gradient[: ctx.n_before],
            *map(torch.from_numpy, place_gradients),
        )


def _numpy_dtype(tensor: Tensor) -> np.dtype:
    return torch.empty(0, dtype=tensor.dtype).numpy().dtype
