"""Image features around a point: a convolution over cubes of voxels at several scales."""

import dataclasses

import numpy as np
import torch
from torch import nn

from meshot.errors import require_positive_integer
from meshot.model.stacked import StackedImages
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Int64, Tensor
from meshot.volume import Volume, mm_to_voxel, volume_pyramid


@dataclasses.dataclass(frozen=True, eq=False)
class FeatureMap:
    """Features at the voxels of an image.

    Parameters
    ----------
    values : tensor
        One row of features per voxel, the last axis varying fastest. The outermost voxels are zero.
    shape : tuple of int
        Number of voxels along the three axes.
    image : Volume
        The image that the features belong to.
    margin : int
        Number of voxels by which the map exceeds the image on each side.
    """

    values: Float[Tensor, "voxels features"]
    shape: tuple[int, int, int]
    image: Volume
    margin: int

    def at(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n features"]:
        """Features at points in mm, by trilinear interpolation, zero outside the map. Differentiable in both."""
        rows, weights = corner_rows(mm_to_voxel(self.image, points) + self.margin, self.shape)
        return nn.functional.embedding_bag(rows, self.values, per_sample_weights=weights, mode="sum")

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """An upper bound of the Lipschitz constant of the features, per mm, from differences of adjacent voxels."""
        grid = self.values.unflatten(0, self.shape)
        steps = torch.stack([grid.diff(dim=axis).norm(dim=-1).max() for axis in range(3)])
        per_mm = np.linalg.norm(np.linalg.inv(self.image.affine[:3, :3]), ord=2)
        return steps.norm() * float(per_mm)


def corner_rows(
    places: Float[Tensor, "n 3"], shape: tuple[int, int, int]
) -> tuple[Int64[Tensor, "n 8"], Float[Tensor, "n 8"]]:
    """The eight voxels around each position on a grid, as indices into the flat grid, and their trilinear weights."""
    last = places.new_tensor(shape) - 1
    places = torch.minimum(places.clamp(min=0), last)
    lower = torch.minimum(places.detach().floor(), last - 1)
    x, y, z = (torch.stack([1 - part, part], dim=1) for part in (places - lower).unbind(dim=1))  # (n, 2) each
    weights = (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).flatten(1)
    _, ny, nz = shape
    strides = torch.tensor([ny * nz, nz, 1], device=places.device)
    corners = torch.tensor(list(np.ndindex(2, 2, 2)), device=places.device)
    # Sums of products: a GPU has no matrix product of whole numbers.
    first, steps = ((voxels * strides).sum(dim=1) for voxels in (lower.long(), corners))
    return first[:, None] + steps, weights


class CubeConvolution(nn.Module):
    """A 3D convolution over the cubes of voxels around a point, with one cube for every scale of an image.

    z(x) = b + Σ_s Σ_o w_s[o] · I_s(x + o). Here o runs over the size³ offsets by whole voxels of scale s, and I_s is
    the image at scale s with trilinear interpolation, zero outside. Because the offsets are whole voxels, two
    computations are equivalent: extracting the cubes at every point and convolving them (:meth:`cut`), and convolving
    the image once and interpolating the result (:meth:`maps` and :meth:`at`). They agree up to rounding in values and
    gradients, also in gradients with respect to the points.

    Parameters
    ----------
    n_features : int
    n_scales : int
        Number of images, at 1, 2, 4, ... times the voxel size.
    size : int
        Number of voxels along each side of a cube, odd.
    generator : generator or int
        Source of the initial weights, normal with standard deviation 1/√(inputs). The bias is initially zero.

    Raises
    ------
    ValueError
        If a count is not a positive integer, or ``size`` is even.

    References
    ----------
    Le et al., ICLR 2024, appendix (network architecture); Ma et al., *CortexODE*, IEEE TMI 2022.
    """

    def __init__(self, n_features: int = 128, n_scales: int = 3, size: int = 5, generator: Generator = 0):
        super().__init__()
        for name, count in (("n_features", n_features), ("n_scales", n_scales), ("size", size)):
            require_positive_integer(count, name)
        if size % 2 == 0:
            raise ValueError(f"size is {size}; an odd number is needed, so that the cube has a voxel in its middle")
        shape = (n_features, n_scales, size, size, size)
        weight = numpy_generator(generator).standard_normal(shape) / np.sqrt(n_scales * size**3)
        self.weight = nn.Parameter(torch.from_numpy(weight))
        self.bias = nn.Parameter(torch.zeros(n_features, dtype=torch.float64))

    def images(self, volume: Volume) -> tuple[Volume, ...]:
        """The volume at each of the scales of the convolution."""
        return volume_pyramid(volume, self.weight.shape[1])

    def maps(self, images: tuple[Volume, ...]) -> tuple[FeatureMap, ...]:
        """The convolution of every image, as input of :meth:`at`.

        Raises
        ------
        ValueError
            If the number of images differs from the number of scales.
        """
        self._require_scales(images)
        half = self.weight.shape[-1] // 2
        padding = 2 * half + 1  # all positions where a cube overlaps the image, and one layer of zeros around them
        maps = []
        for image, kernel in zip(images, self.weight.unbind(dim=1)):
            data = torch.as_tensor(image.data).to(kernel)
            values = nn.functional.conv3d(data[None, None], kernel[:, None], padding=padding)[0].permute(1, 2, 3, 0)
            maps.append(FeatureMap(values.flatten(0, 2), tuple(values.shape[:3]), image, half + 1))
        return tuple(maps)

    def at(self, maps: tuple[FeatureMap, ...], points: Float[Tensor, "n 3"]) -> Float[Tensor, "n features"]:
        """The features at points in mm, from the convolved images of :meth:`maps`."""
        return self.bias + sum(level.at(points) for level in maps)

    def stacked(self, images: tuple[Volume, ...]) -> StackedImages:
        """The images on the device of the layer, as input of :meth:`cut`.

        Raises
        ------
        ValueError
            If the number of images differs from the number of scales.
        """
        self._require_scales(images)
        return StackedImages(images, self.weight.shape[-1], self.weight)

    def corner_kernels(self) -> Float[Tensor, "scales voxels columns"]:
        """The kernel at each corner of a voxel, for the (size + 1)³ voxels around: input of :meth:`cut`."""
        padded = [nn.functional.pad(self.weight, (z, 1 - z, y, 1 - y, x, 1 - x)) for x, y, z in np.ndindex(2, 2, 2)]
        return torch.stack(padded).flatten(3).permute(2, 3, 0, 1).flatten(2)

    def cut(self, images: StackedImages, kernels: Tensor, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n features"]:
        """The same features, from cubes extracted around every point. On a CPU slow for many points.

        ``kernels`` are those of :meth:`corner_kernels`. They follow the weights, so they are made again in every step.
        """
        voxels, shares = images.corners(points)
        at_corners = torch.bmm(voxels, kernels).unflatten(2, (8, -1))  # (scales, n, 8, features)
        return self.bias + (at_corners * shares[..., None]).sum(dim=(0, 2))

    def _require_scales(self, images: tuple[Volume, ...]) -> None:
        if len(images) != self.weight.shape[1]:
            raise ValueError(
                f"{len(images)} images were given, {self.weight.shape[1]} are needed: see CubeConvolution.images"
            )
