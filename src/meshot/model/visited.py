"""Features of an image at the voxels that points come near, each convolved once, when it is first needed."""

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from meshot.model import _kernel_visited as kernel
from meshot.model.cubes import CubeConvolution
from meshot.types import Array, Float, Int64, Tensor
from meshot.volume import Volume, mm_to_voxel


class VisitedFeatures:
    """What :meth:`meshot.model.cubes.CubeConvolution.at` gives, from a convolution at the visited voxels only.

    A surface comes near few voxels of an image, a tenth of those in its box; the others need not be convolved. Rows of
    features are kept, for all scales in one table, so that a voxel is convolved once however often points come back.
    On a CPU; the gradient can be taken once.

    Parameters
    ----------
    cubes : CubeConvolution
    images : tuple of Volume
        One for each scale, see :meth:`meshot.model.cubes.CubeConvolution.images`.
    """

    def __init__(self, cubes: CubeConvolution, images: tuple[Volume, ...]):
        self.cubes = cubes
        self.levels = [_Level(image, cubes.weight.shape[-1], cubes.weight) for image in images]
        self.rows = _Rows(cubes.weight)
        self.values = cubes.weight.new_zeros((0, cubes.weight.shape[0]))

    def at(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n features"]:
        """The features at points in mm, trilinear between voxels, zero beyond the image; differentiable."""
        places = [level.places(points) for level in self.levels]
        found, self.values = _Interpolated.apply(self, self.cubes.weight, self.values, *places)
        return self.cubes.bias + found


class _Level:
    """One scale: its image, padded so that every cube that touches it has voxels, and which row holds which voxel."""

    def __init__(self, image: Volume, size: int, like: Tensor):
        half = size // 2
        self.image, self.size, self.margin = image, size, half + 1
        self.shape = tuple(n + 2 * self.margin for n in image.data.shape)
        self.padded = np.pad(image.data, self.margin + half).astype(_numpy_dtype(like))
        self.row_of = np.full(np.prod(self.shape), -1, np.int32)

    def places(self, points: Tensor) -> Tensor:
        """Points in voxels of the padded grid; those beyond it are moved to its rim, where all is zero."""
        last = points.new_tensor(self.shape) - 1
        return torch.minimum((mm_to_voxel(self.image, points) + self.margin).clamp(min=0), last)

    def cubes(self, voxels: Int64[Array, " k"]) -> Float[Array, "k cube"]:
        """The cubes of voxels around the given ones."""
        cubes = np.empty((len(voxels), self.size**3), self.padded.dtype)
        kernel.cut_cubes(self.padded, voxels, self.shape, self.size, cubes)
        return cubes


class _Rows:
    """Room for rows of features that grows, so that appending does not copy what is there."""

    def __init__(self, like: Tensor):
        self.room = like.detach().new_empty((0, like.shape[0]))

    def with_rows(self, n_rows: int) -> Tensor:
        """The first rows, as many as asked for; those written before are kept."""
        if n_rows > len(self.room):
            larger = self.room.new_empty((max(n_rows, 3 * len(self.room) // 2), self.room.shape[1]))
            larger[: len(self.room)] = self.room
            self.room = larger
        return self.room[:n_rows]


class _Interpolated(torch.autograd.Function):
    """Features at places on every level, and the table of rows with those that were new.

    The table goes from call to call, and so does its gradient, back: each call adds its own to it, takes the part of
    the rows that it made, for the weight, and hands on the rest.
    """

    @staticmethod
    def forward(ctx, features, weight, before, *places):
        ctx.set_materialize_grads(False)
        ctx.levels, ctx.made, n_rows = features.levels, [], len(before)
        kernels = weight.detach().flatten(2)  # (features, scales, size³)
        # A place that is not a number has no voxel; it is read at the first, and its features are no numbers either.
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
        # An output that is kept as it is would keep this very graph alive, and with it all its memory.
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
