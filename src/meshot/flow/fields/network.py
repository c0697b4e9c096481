"""A velocity field computed by a small network from position and time."""

import itertools

import torch
from torch import nn

from meshot.errors import require_positive_integer
from meshot.flow.fields.field import LearnedVelocity
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor


class NetworkVelocity(LearnedVelocity):
    """A multilayer perceptron of position and, optionally, time, with tanh between its layers. It is smooth everywhere.

    Parameters
    ----------
    n_dimensions : int
        Dimension of the points and of the velocities.
    width, n_layers : int
        Neurons per hidden layer, and number of hidden layers.
    generator : numpy.random.Generator, torch.Generator or int
        Source of the initial weights, which are normal with standard deviation 1/√(inputs); biases are uniform in
        [−1, 1].
    extent : float
        Positions are divided by it before they enter the network. About half the size of the shape is suitable.
    last_scale : float
        Scale of the initial weights of the last layer. With 0 the velocity is initially zero.
    with_time : bool
        Whether time is an additional input. Otherwise the field is stationary.

    Raises
    ------
    ValueError
        If a count is not a positive integer, or ``extent`` is not positive.
    """

    def __init__(
        self,
        n_dimensions: int,
        width: int = 64,
        n_layers: int = 2,
        generator: Generator = 0,
        extent: float = 1.0,
        last_scale: float = 0.0,
        with_time: bool = True,
    ):
        super().__init__()
        for name, count in (("n_dimensions", n_dimensions), ("width", width), ("n_layers", n_layers)):
            require_positive_integer(count, name)
        if not extent > 0:
            raise ValueError(f"extent is {extent!r}; a positive length is needed, in units of the points")
        self.n_dimensions, self.extent, self.with_time = n_dimensions, float(extent), with_time
        generator = numpy_generator(generator)
        sizes = [n_dimensions + with_time, *[width] * n_layers, n_dimensions]
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        for index, (n_in, n_out) in enumerate(itertools.pairwise(sizes)):
            scale = last_scale if index == n_layers else 1.0
            self.weights.append(torch.from_numpy(scale / n_in**0.5 * generator.standard_normal((n_out, n_in))))
            self.biases.append(torch.from_numpy(scale * generator.uniform(-1, 1, n_out)))

    def forward(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        values = points / self.extent
        if self.with_time:
            values = torch.cat([values, time.to(points).expand(len(points), 1)], dim=1)
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases)):
            values = nn.functional.linear(values if index == 0 else values.tanh(), weight, bias)
        return values

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The product of the spectral norms of the layers, per unit of time. The slope of tanh is at most one.

        In the first layer only the columns of the position count. The bound is not tight, because the layers do not
        all stretch the same direction.
        """
        first = self.weights[0][:, : self.n_dimensions] / self.extent
        norms = [torch.linalg.matrix_norm(weight, ord=2) for weight in [first, *list(self.weights)[1:]]]
        return torch.stack(norms).prod()
