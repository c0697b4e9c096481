"""The deformation network: the velocity of a vertex from its position and from the image around it."""

import itertools
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import torch
from torch import nn

from meshot.errors import require_choice, require_positive, require_positive_integer
from meshot.flow.fields import LearnedVelocity, Prepared
from meshot.model.cubes import CubeConvolution
from meshot.model.stacked import StackedImages
from meshot.model.visited import VisitedFeatures
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor
from meshot.volume import Volume

Path = Literal["convolved", "visited", "cut"]
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
    generator : generator or int
        Source of the initial weights. Those of the last layer are zero, so that the initial velocity is a small
        constant: its bias, which does not depend on the unit.

    Raises
    ------
    ValueError
        If a count is not a positive integer or is too large, or ``extent`` or ``velocity_unit`` is not positive.

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
        generator: Generator = 0,
    ):
        super().__init__()
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

    def config(self) -> dict[str, int | float | list[int]]:
        """The arguments that create a network of the same architecture."""
        return {
            "width": self.of_image.out_features,
            "hidden": [layer.out_features for layer in self.perceptron],
            "n_scales": self.cubes.weight.shape[1],
            "size": self.cubes.weight.shape[2],
            "extent": self.extent,
            "velocity_unit": self.velocity_unit,
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

    Raises
    ------
    ValueError
        If ``path`` is unknown.
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
            stacked, kernels = self._stacked(), network.cubes.corner_kernels()
            return Prepared(lambda _, at: network(at, network.cubes.cut(stacked, kernels, at)), (*others, kernels))
        maps = network.cubes.maps(images)
        tensors = (*others, *(level.values for level in maps))
        return Prepared(lambda _, points: network(points, network.cubes.at(maps, points)), tensors)

    def _stacked(self) -> StackedImages:
        """The images for the path "cut". They are kept, and made again if the network has moved."""
        weight = self.network.cubes.weight
        if self._kept is None or self._kept.values.device != weight.device or self._kept.values.dtype != weight.dtype:
            self._kept = self.network.cubes.stacked(self.images)
        return self._kept

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
