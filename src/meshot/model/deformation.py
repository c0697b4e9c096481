"""The deformation network: the velocity of a vertex from its position and from the image around it."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import torch
from torch import nn
from torch.autograd.function import once_differentiable

from meshot.errors import require_choice, require_positive, require_positive_integer
from meshot.flow import LearnedVelocity, Prepared
from meshot.model import _kernel_cubes
from meshot.model.features import StackedImages
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Int64, Tensor
from meshot.volume import Volume, mm_to_voxel, volume_pyramid

Path = Literal["convolved", "visited", "cut"]
Intensities = Literal["surface", "tissues"]
N_STEPS = 10  # Euler steps, as in the paper
SLOPE = 0.2  # slope of the leaky ReLU for negative values


class DeformationNetwork(nn.Module):
    """A network that computes a velocity from a position and from image features at this position.

    The position passes through a linear layer. The cubes of voxels around it at several scales pass through a
    convolution and a linear layer. Both results are concatenated and pass through a multilayer perceptron with leaky
    ReLU. The network contains no data of a subject: :meth:`velocity_in` makes the velocity field for an image.

    Parameters
    ----------
    width : int
        Number of features of the position, and of the image.
    hidden : sequence of int
        Neurons in the hidden layers of the perceptron.
    n_scales, size : int
        Number of scales (1, 2, 4, ... times the voxel size), and number of voxels along the side of a cube, odd.
    extent : float
        In mm. Positions are divided by it before they enter the network.
    velocity_unit : float
        In mm per unit of time. The output of the last layer is multiplied by it. CortexODE moves points in units of
        half the image: this corresponds to 104 mm. The larger the unit, the faster the last layer learns.
    intensities : str
        How the image is scaled that the network sees: over the "surface" that is moved, or between the "tissues" beside
        it. See :func:`meshot.systems.standardised` and :func:`meshot.systems.scaled_between_tissues`.
    generator : generator or int
        Source of the initial weights. Those of the last layer are zero, so that the initial velocity is a small
        constant: its bias, which does not depend on the unit.

    Raises
    ------
    ValueError
        If a count is not a positive integer or is too large, ``extent`` or ``velocity_unit`` is not positive, or
        ``intensities`` is neither of the two.

    Notes
    -----
    The paper gives the width (128) and the cubes (5³ voxels), but not the number of scales, the layers of the
    perceptron or its activation. Ours follow CortexODE, on which the paper builds.

    References
    ----------
    Le et al., ICLR 2024, appendix (network architecture); Ma et al., *CortexODE*, IEEE TMI 2022.
    """

    def __init__(
        self,
        width: int = 128,
        hidden: Sequence[int] = (512, 256),
        n_scales: int = 3,
        size: int = 5,
        extent: float = 100.0,
        velocity_unit: float = 1.0,
        intensities: Intensities = "surface",
        generator: Generator = 0,
    ):
        super().__init__()
        require_choice(intensities, "intensities", get_args(Intensities))
        self.intensities = intensities
        # Limits far above what can be stored (see require_small), to prevent excessive memory use.
        for name, count in [("width", width), *(("hidden", n) for n in hidden)]:
            require_positive_integer(count, name, 2048)
        require_positive_integer(len(hidden), "the number of hidden layers", 16)
        for name, count in (("n_scales", n_scales), ("size", size)):
            require_positive_integer(count, name, 15)
        for name, length in (("extent", extent), ("velocity_unit", velocity_unit)):
            require_positive(length, name, "mm")
        generator = numpy_generator(generator)
        self.extent, self.velocity_unit = float(extent), float(velocity_unit)
        self.of_position = _linear(3, width, generator)
        self.cubes = CubeConvolution(width, n_scales, size, generator)
        self.of_image = _linear(width, width, generator)
        sizes = [2 * width, *hidden]
        self.perceptron = nn.ModuleList(_linear(*counts, generator) for counts in itertools.pairwise(sizes))
        self.to_velocity = _linear(sizes[-1], 3, generator)
        nn.init.zeros_(self.to_velocity.weight)
        self.to_velocity.bias.data /= self.velocity_unit

    def forward(
        self, points: Float[Tensor, "n 3"], image_features: Float[Tensor, "n features"]
    ) -> Float[Tensor, "n 3"]:
        """The velocity of every point, in mm per unit of time."""
        values = torch.cat([self.of_position(points / self.extent), self.of_image(image_features)], dim=1)
        for layer in self.perceptron:
            values = layer(nn.functional.leaky_relu(values, SLOPE))
        return self.velocity_unit * self.to_velocity(nn.functional.leaky_relu(values, SLOPE))

    def velocity_in(self, image: Volume, path: Path = "convolved") -> "ImageVelocity":
        """The velocity field for an image. The network can be trained through it; the image is not a parameter."""
        return ImageVelocity(self, image, path)

    def config(self) -> dict[str, int | float | str | list[int]]:
        """The arguments that create a network of the same architecture."""
        return {
            "width": self.of_image.out_features,
            "hidden": [layer.out_features for layer in self.perceptron],
            "n_scales": self.cubes.weight.shape[1],
            "size": self.cubes.weight.shape[2],
            "extent": self.extent,
            "velocity_unit": self.velocity_unit,
            "intensities": self.intensities,
        }

    @property
    def n_parameters(self) -> int:
        """The number of trainable parameters."""
        return sum(parameter.numel() for parameter in self.parameters())


class ImageVelocity(LearnedVelocity):
    """The velocity field of a network for one image: stationary, Lipschitz, in mm per unit of time.

    Parameters
    ----------
    network : DeformationNetwork
        Shared, not copied.
    image : Volume
        In the space of the points, with intensities scaled as in the training of the network.
    path : str
        "convolved": the image is convolved once per flow, then interpolated. "visited": the same, but only at voxels
        near points (on a CPU; not for the adjoint method). "cut": cubes are extracted around the points at every step.
        All give the same values.
    """

    def __init__(self, network: DeformationNetwork, image: Volume, path: Path = "convolved"):
        super().__init__()
        require_choice(path, "path", get_args(Path))
        self.network, self.path = network, path
        self.images = network.cubes.images(image)
        self._kept: StackedImages | None = None

    def prepared(self) -> Prepared:
        """The field with its image already convolved."""
        network, images = self.network, self.images
        if self.path == "visited":
            visited = VisitedFeatures(network.cubes, images)
            return Prepared(lambda _, points: network(points, visited.at(points)), tuple(network.parameters()))
        # What is computed from the convolution weight takes its place, so that its gradient is not counted twice.
        others = [parameter for parameter in network.parameters() if parameter is not network.cubes.weight]
        if self.path == "cut":
            weight, kept = network.cubes.weight, self._kept
            # The images are kept, and made again if the network has moved.
            if kept is None or kept.values.device != weight.device or kept.values.dtype != weight.dtype:
                self._kept = network.cubes.stacked(self.images)
            stacked, kernels = self._kept, network.cubes.corner_kernels()
            return Prepared(lambda _, at: network(at, network.cubes.cut(stacked, kernels, at)), (*others, kernels))
        maps = network.cubes.maps(images)
        tensors = (*others, *(level.values for level in maps))
        return Prepared(lambda _, points: network(points, network.cubes.at(maps, points)), tensors)

    def forward(self, time: Float[Tensor, ""], points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """The velocity of every point."""
        return self.prepared()(time, points)

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """An upper bound: the product of the spectral norms of the layers and of the features' slope. Not tight.

        Per unit of time. A leaky ReLU has slope at most one. The slope of the image features is bounded by the sum over
        the scales of their largest differences between neighbouring voxels.
        """
        network = self.network
        of_image = sum(level.lipschitz_bound() for level in network.cubes.maps(self.images))
        entering = torch.stack([_norm(network.of_position) / network.extent, _norm(network.of_image) * of_image]).norm()
        layers = [*network.perceptron, network.to_velocity]
        return network.velocity_unit * entering * torch.stack([_norm(layer) for layer in layers]).prod()


def _norm(layer: nn.Linear) -> Float[Tensor, ""]:
    return torch.linalg.matrix_norm(layer.weight, ord=2)


def _linear(n_in: int, n_out: int, generator: np.random.Generator) -> nn.Linear:
    """A linear layer in float64. Weights: normal, standard deviation 1/√(inputs); biases: uniform in ± 1/√(inputs)."""
    layer = nn.utils.skip_init(nn.Linear, n_in, n_out, dtype=torch.float64)
    with torch.no_grad():
        layer.weight.copy_(torch.from_numpy(generator.standard_normal((n_out, n_in)) / n_in**0.5))
        layer.bias.copy_(torch.from_numpy(generator.uniform(-1, 1, n_out) / n_in**0.5))
    return layer


# Image features around a point: a convolution over cubes of voxels at several scales.


@dataclasses.dataclass(frozen=True, eq=False)
class FeatureMap:
    """Features at the voxels of an image."""

    values: Float[Tensor, "voxels features"]  # a row per voxel, the last axis fastest; the outermost are zero
    shape: tuple[int, int, int]  # number of voxels along the three axes
    image: Volume  # to which the features belong
    margin: int  # number of voxels by which the map exceeds the image on each side

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
    """A 3D convolution over the cubes of voxels around a point, with one cube for every scale of an image."""

    # z(x) = b + Σ_s Σ_o w_s[o] · I_s(x + o). Here o runs over the size³ offsets by whole voxels of scale s, and I_s is
    # the image at scale s with trilinear interpolation, zero outside. Because the offsets are whole voxels, two
    # computations are equivalent: extracting the cubes at every point and convolving them (:meth:`cut`), and convolving
    # the image once and interpolating the result (:meth:`maps` and :meth:`at`). They agree up to rounding in values and
    # gradients, also in gradients with respect to the points.
    # ``n_scales``: number of images, at 1, 2, 4, ... times the voxel size.
    # ``size``: number of voxels along each side of a cube, odd.
    # ``generator``: source of the initial weights, normal with standard deviation 1/√(inputs). The bias is initially
    # zero.
    # Le et al., ICLR 2024, appendix (network architecture); Ma et al., *CortexODE*, IEEE TMI 2022.

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
        """The convolution of every image, as input of :meth:`at`."""
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
        """The images on the device of the layer, as input of :meth:`cut`."""
        self._require_scales(images)
        return StackedImages(images, self.weight.shape[-1], self.weight)

    def corner_kernels(self) -> Float[Tensor, "scales voxels columns"]:
        """The kernel at each corner of a voxel, for the (size + 1)³ voxels around: input of :meth:`cut`."""
        padded = [nn.functional.pad(self.weight, (z, 1 - z, y, 1 - y, x, 1 - x)) for x, y, z in np.ndindex(2, 2, 2)]
        return torch.stack(padded).flatten(3).permute(2, 3, 0, 1).flatten(2)

    def cut(self, images: StackedImages, kernels: Tensor, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n features"]:
        """The same features, from cubes extracted around every point. On a CPU slow for many points."""
        # ``kernels`` are those of :meth:`corner_kernels`. They follow the weights, so they are made again in every
        # step.
        voxels, shares = images.corners(points)
        at_corners = torch.bmm(voxels, kernels).unflatten(2, (8, -1))  # (scales, n, 8, features)
        return self.bias + (at_corners * shares[..., None]).sum(dim=(0, 2))

    def _require_scales(self, images: tuple[Volume, ...]) -> None:
        if len(images) != self.weight.shape[1]:
            raise ValueError(
                f"{len(images)} images were given, {self.weight.shape[1]} are needed: see CubeConvolution.images"
            )


# Image features computed only at the voxels near points, each once, on first use.


class VisitedFeatures:
    """The features of :meth:`meshot.model.deformation.CubeConvolution.at`, convolved only at visited voxels."""

    # A surface is near only about a tenth of the voxels in its bounding box. Rows of features for all scales are kept
    # in one table, so that each voxel is convolved once. Runs on a CPU. Only first derivatives are available.

    def __init__(self, cubes: CubeConvolution, images: tuple[Volume, ...]):
        self.cubes = cubes
        self.levels = [_Level(image, cubes.weight.shape[-1], cubes.weight) for image in images]
        self.room = cubes.weight.detach().new_empty((0, cubes.weight.shape[0]))  # a growing buffer for the table
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
        self.padded = np.pad(image.data, self.margin + half).astype(torch.empty(0, dtype=like.dtype).numpy().dtype)
        self.row_of = np.full(np.prod(self.shape), -1, np.int32)

    def places(self, points: Tensor) -> Tensor:
        """Points in voxels of the padded grid. Those outside are clipped to its border, where features are zero."""
        last = points.new_tensor(self.shape) - 1
        return torch.minimum((mm_to_voxel(self.image, points) + self.margin).clamp(min=0), last)

    def cubes(self, voxels: Int64[Array, " k"]) -> Float[Array, "k cube"]:
        """The cubes of values around the given voxels."""
        cubes = np.empty((len(voxels), self.size**3), self.padded.dtype)
        _kernel_cubes.cut_cubes(self.padded, voxels, self.shape, self.size, cubes)
        return cubes


class _Interpolated(torch.autograd.Function):
    """Features at positions on every level, and the table of rows including the new ones."""

    # The table is passed from call to call, and its gradient in the opposite order. Each call adds its own gradient to
    # it, uses the part of the rows that it made for the gradient of the weight, and passes on the rest.

    @staticmethod
    def forward(ctx, features, weight, before, *places):
        ctx.set_materialize_grads(False)
        ctx.levels, ctx.made, n_rows = features.levels, [], len(before)
        kernels = weight.detach().flatten(2)  # (features, scales, size³)
        # A position with NaN has no voxel. It is looked up at the first voxel, and its features are set to NaN.
        lost = torch.stack([place.detach().isnan().any(dim=1) for place in places]).any(dim=0)
        arrays = [np.ascontiguousarray(place.detach().nan_to_num().numpy()) for place in places]
        for scale, (level, array) in enumerate(zip(features.levels, arrays, strict=True)):
            new = _kernel_cubes.visit(array, level.shape, level.row_of, n_rows)
            cubes = torch.from_numpy(level.cubes(new))
            n_needed, room = n_rows + len(new), features.room
            if n_needed > len(room):  # by half as much again, so that appending rarely copies
                features.room = room.new_empty((max(n_needed, 3 * len(room) // 2), room.shape[1]))
                features.room[: len(room)] = room
            table = features.room[:n_needed]
            torch.mm(cubes, kernels[:, scale].T, out=table[n_rows:])
            ctx.made.append((slice(n_rows, n_rows + len(new)), cubes))
            n_rows += len(new)
        found = weight.new_zeros((len(arrays[0]), weight.shape[0]))
        for level, array in zip(features.levels, arrays, strict=True):
            _kernel_cubes.interpolate(array, level.shape, level.row_of, table.numpy(), found.numpy())
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
                _kernel_cubes.carry_back(array, level.shape, level.row_of, values, given, into, place_gradient)
        weight_gradient = torch.stack([table_gradient[rows].T @ cubes for rows, cubes in ctx.made], dim=1)
        return (
            None,
            weight_gradient.view(ctx.weight_shape),
            table_gradient[: ctx.n_before],
            *map(torch.from_numpy, place_gradients),
        )
