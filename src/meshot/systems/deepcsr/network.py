"""The network of DeepCSR: from a scan and points in mm to the signed distances of the points from surfaces."""

import dataclasses

import torch
from torch import nn

from meshot.errors import require_positive, require_positive_integer
from meshot.model import FeatureNetwork, initialise, sample_features
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor
from meshot.volume import Volume, mm_to_voxel


@dataclasses.dataclass(frozen=True)
class NetworkSettings:
    """Architecture: see :class:`meshot.systems.deepcsr.network.DistanceNetwork`."""

    width: int = 16
    depth: int = 4
    fold: int = 2
    hidden: int = 64
    n_blocks: int = 5
    unit: float = 5.0


class DistanceNetwork(nn.Module):
    """Signed distances (mm, negative inside) of points from several surfaces in one scan.

    Parameters
    ----------
    n_surfaces : int
    width, depth, fold : int
        Of the encoder: see :class:`meshot.model.FeatureNetwork`.
    hidden, n_blocks : int
        Number of neurons, and of residual blocks, of the decoder.
    unit : float
        In mm. The output of the last layer is multiplied by it.
    generator : generator or int
        Source of the initial weights.

    Raises
    ------
    ValueError
        If a count is not a positive integer, or the unit is not a positive length.
    """

    def __init__(
        self, n_surfaces: int = 2, width: int = 16, depth: int = 4, fold: int = 2, hidden: int = 64, n_blocks: int = 5,
        unit: float = 5.0, generator: Generator = 0,
    ):  # fmt: skip
        super().__init__()
        for name, count, most in (("n_surfaces", n_surfaces, 8), ("hidden", hidden, 2048), ("n_blocks", n_blocks, 50)):
            require_positive_integer(count, name, most)
        require_positive(unit, "unit", "mm")
        generator = numpy_generator(generator)
        self.arguments = {"n_surfaces": n_surfaces, "width": width, "depth": depth, "fold": fold, "hidden": hidden}
        self.arguments |= {"n_blocks": n_blocks, "unit": float(unit)}
        self.unit = float(unit)
        self.encoder = FeatureNetwork(width, depth, fold, decoder=False, generator=generator)
        widths = self.encoder.widths
        self.of_whole = nn.Linear(widths[-1], widths[-1])
        self.of_position = nn.Linear(3, hidden)
        n_features = sum(widths) + widths[-1]
        self.blocks = nn.ModuleList(_Block(hidden, n_features) for _ in range(n_blocks))
        self.last = _Modulated(hidden, n_features)
        self.to_distance = nn.Linear(hidden, n_surfaces)
        for part in (self.of_whole, self.of_position, self.blocks, self.last, self.to_distance):
            initialise(part, generator)
        with torch.no_grad():  # every block begins as the identity, every modulation as none
            for block in self.blocks:
                block.second.weight.zero_()
            for layer in (each for each in self.modules() if isinstance(each, _Modulated)):
                layer.to_scale.weight.zero_()
                layer.to_shift.weight.zero_()

    def config(self) -> dict[str, int | float]:
        """The arguments that create a network of the same architecture."""
        return dict(self.arguments)

    def encode(self, image: Float[Tensor, "1 1 x y z"]) -> tuple[list[Tensor], Tensor]:
        """The maps of the encoder, and one vector for the whole image."""
        maps = self.encoder(image)
        return maps, nn.functional.relu(self.of_whole(maps[-1].mean(dim=(2, 3, 4))))

    def forward(
        self, maps: list[Tensor], whole: Float[Tensor, "1 g"], image: Volume, points: Float[Tensor, "n 3"]
    ) -> Float[Tensor, "n s"]:
        """The distances of points, in mm.

        Parameters
        ----------
        maps, whole
            The result of :meth:`encode`.
        image : Volume
            The scan, whose affine places the maps.
        points : tensor
            In mm.
        """
        features = torch.cat([whole.expand(len(points), -1), sample_features(maps, image, points)], dim=1)
        places = 2 * (mm_to_voxel(image, points) + 0.5) / points.new_tensor(image.data.shape) - 1
        values = self.of_position(places)
        for block in self.blocks:
            values = block(values, features)
        return self.unit * self.to_distance(nn.functional.relu(self.last(values, features)))


class _Modulated(nn.Module):
    """Normalisation over the neurons of a point, then a scale and a shift that depend on the features."""

    def __init__(self, hidden: int, n_features: int):
        super().__init__()
        self.to_scale, self.to_shift = nn.Linear(n_features, hidden), nn.Linear(n_features, hidden)

    def forward(self, values: Tensor, features: Tensor) -> Tensor:
        normal = nn.functional.layer_norm(values, values.shape[1:])
        return (1 + self.to_scale(features)) * normal + self.to_shift(features)


class _Block(nn.Module):
    def __init__(self, hidden: int, n_features: int):
        super().__init__()
        self.before, self.between = _Modulated(hidden, n_features), _Modulated(hidden, n_features)
        self.first, self.second = nn.Linear(hidden, hidden), nn.Linear(hidden, hidden)

    def forward(self, values: Tensor, features: Tensor) -> Tensor:
        inner = self.first(nn.functional.relu(self.before(values, features)))
        return values + self.second(nn.functional.relu(self.between(inner, features)))
