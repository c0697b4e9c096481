"""Losses between two measures, selected by name, with their settings."""

import abc
import dataclasses
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from meshot.errors import require_choice, require_positive, require_positive_integer
from meshot.loss.directions import random_directions
from meshot.loss.kernel_norm import ANGULAR, varifold_kernel
from meshot.loss.nearest import chamfer
from meshot.loss.sinkhorn import sinkhorn_divergence
from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.unbalanced import sliced_partial, sliced_unbalanced
from meshot.loss.windowed import drawn_windows, windowed_sliced_wasserstein
from meshot.measure import Measure
from meshot.types import Float, Tensor


class MeasureLoss(abc.ABC):
    """A loss between measures: a frozen dataclass whose fields are its settings.

    Attributes
    ----------
    takes_continuous : bool
        Whether the loss accepts measures without support points.
    """

    takes_continuous: ClassVar[bool] = False

    @abc.abstractmethod
    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss. Random numbers are drawn from ``generator``."""

    def at(self, done: float) -> "MeasureLoss":
        """The loss when this share of the steps of a training is done, in [0, 1]."""
        return self


@dataclasses.dataclass(frozen=True)
class SlicedLoss(MeasureLoss):
    """The sliced Wasserstein distance, to the power p: see :func:`meshot.sliced_wasserstein`.

    Parameters
    ----------
    n_directions : int
        Number of directions, drawn in every call.
    p : int
        The exponent: 1 or 2.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    takes_continuous: ClassVar[bool] = True
    n_directions: int = 100
    p: int = 2

    def __post_init__(self):
        require_positive_integer(self.n_directions, "n_directions")
        _require_exponent(self.p)

    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss along newly drawn directions."""
        directions = random_directions(self.n_directions, source.places.shape[1], generator).to(source.places)
        return sliced_wasserstein(source, target, directions, self.p)


@dataclasses.dataclass(frozen=True)
class WindowedLoss(MeasureLoss):
    """The sliced distance in spatial windows: see :func:`meshot.windowed_sliced_wasserstein`. Not in the paper.

    Parameters
    ----------
    window : float
        Standard deviation of the windows, in mm.
    n_windows : int
        Number of windows drawn in every call, centred at positions of the target, by mass.
    n_directions : int
        Number of directions per window.
    p : int
        The exponent: 1 or 2.
    last_window : float, optional
        Standard deviation at the end of a training. It changes by the same factor in every step. Default: no change.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    window: float = 6.0
    n_windows: int = 32
    n_directions: int = 100
    p: int = 2
    last_window: float | None = None

    def __post_init__(self):
        require_positive(self.window, "window")
        if self.last_window is not None:
            require_positive(self.last_window, "last_window")
        require_positive_integer(self.n_windows, "n_windows")
        require_positive_integer(self.n_directions, "n_directions")
        _require_exponent(self.p)

    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss in newly drawn windows, each with its own directions."""
        centres, sets = drawn_windows(target, self.n_windows, self.n_directions, generator)
        return windowed_sliced_wasserstein(source, target, centres, self.window, sets, self.p)

    def at(self, done: float) -> "WindowedLoss":
        """The loss with the radius that belongs to this share of the steps, in [0, 1]."""
        factor = (self.last_window or self.window) / self.window
        return dataclasses.replace(self, window=self.window * factor**done)


@dataclasses.dataclass(frozen=True)
class ChamferLoss(MeasureLoss):
    """The Chamfer distance, squared: see :func:`meshot.chamfer`."""

    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss. Nothing is random."""
        return chamfer(source, target)


@dataclasses.dataclass(frozen=True)
class SinkhornLoss(MeasureLoss):
    """The debiased Sinkhorn divergence: see :func:`meshot.sinkhorn_divergence`.

    Parameters
    ----------
    p : int
        The exponent: 1 or 2.
    blur : float
        In mm.
    scaling : float
        In (0, 1). Values closer to one are slower and more accurate.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    p: int = 2
    blur: float = 5.0
    scaling: float = 0.5

    def __post_init__(self):
        _require_exponent(self.p)
        require_positive(self.blur, "blur")
        if not 0 < self.scaling < 1:
            raise ValueError(f"scaling is {self.scaling!r}; a number in (0, 1) is needed")

    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss. Nothing is random."""
        return sinkhorn_divergence(source, target, self.p, self.blur, self.scaling)


@dataclasses.dataclass(frozen=True)
class VarifoldKernelLoss(MeasureLoss):
    """The kernel norm of varifolds: see :func:`meshot.loss.varifold_kernel`. Not in the paper.

    Parameters
    ----------
    width : float
        Of the Gaussian in space, in mm.
    angular : str
        The kernel of the normals: currents, varifold or oriented.

    Raises
    ------
    ValueError
        If the width is not positive or the kernel is unknown.
    """

    width: float = 5.0
    angular: str = "oriented"

    def __post_init__(self):
        require_positive(self.width, "width")
        require_choice(self.angular, "angular", ANGULAR)

    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss. Nothing is random."""
        return varifold_kernel(source, target, self.width, self.angular)


@dataclasses.dataclass(frozen=True)
class SlicedPartialLoss(MeasureLoss):
    """Partial transport along directions: see :func:`meshot.loss.unbalanced.sliced_partial`. Not in the paper.

    Parameters
    ----------
    reach : float
        The length beyond which nothing is transported along a direction, in mm.
    n_directions : int
        Number of directions, drawn in every call.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    solve: ClassVar[Callable] = staticmethod(sliced_partial)
    reach: float = 12.0
    n_directions: int = 100

    def __post_init__(self):
        require_positive(self.reach, "reach")
        require_positive_integer(self.n_directions, "n_directions")

    def __call__(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss along newly drawn directions."""
        directions = random_directions(self.n_directions, source.places.shape[1], generator).to(source.places)
        return self.solve(source, target, self.reach, directions)


@dataclasses.dataclass(frozen=True)
class SlicedUnbalancedLoss(SlicedPartialLoss):
    """Unbalanced transport along directions: see :func:`meshot.loss.unbalanced.sliced_unbalanced`. Not in the paper.

    The settings are those of partial transport; ``reach`` is twice the weight of the penalty.
    """

    solve: ClassVar[Callable] = staticmethod(sliced_unbalanced)


def _require_exponent(p: int) -> None:
    if p not in (1, 2):
        raise ValueError(f"p is {p!r}; 1 or 2 is needed")


#: The losses by name.
LOSSES: dict[str, type[MeasureLoss]] = {
    "sliced": SlicedLoss, "windowed": WindowedLoss, "chamfer": ChamferLoss, "sinkhorn": SinkhornLoss,
    "varifold_kernel": VarifoldKernelLoss, "sliced_partial": SlicedPartialLoss,
    "sliced_unbalanced": SlicedUnbalancedLoss,
}  # fmt: skip
