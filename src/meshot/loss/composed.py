"""Losses between surfaces: an encoding combined with a loss of measures, both selected by name.

``ENCODINGS`` and ``LOSSES`` list the names. :func:`surface_loss` makes a :class:`SurfaceLoss` from a flat mapping of
settings, and raises an error for a setting that neither part uses.
"""

import abc
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np
import torch

from meshot.errors import require_choice, require_positive, require_positive_integer
from meshot.loss.directions import random_directions
from meshot.loss.kernel_norm import ANGULAR, varifold_kernel
from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.transport import chamfer, sinkhorn_divergence
from meshot.loss.unbalanced import sliced_partial, sliced_unbalanced
from meshot.loss.windowed import drawn_windows, windowed_sliced_wasserstein
from meshot.measure import DiscreteMeasure, Measure, SurfaceMeasure, empirical, surface, varifold, varifold_sample
from meshot.mesh import Mesh
from meshot.types import Float, Tensor

# Encodings of a mesh as a measure, selected by name, with their settings.


class Encoding(abc.ABC):
    """An encoding of a mesh as a measure: a frozen dataclass whose fields are its settings.

    Attributes
    ----------
    continuous : bool
        Whether the measure has no support points. Only some losses accept such measures.
    """

    continuous: ClassVar[bool] = False

    @abc.abstractmethod
    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> Measure:
        """The measure of a mesh. ``n_default`` is the number of support points if one is needed and not set."""


@dataclasses.dataclass(frozen=True)
class VarifoldEncoding(Encoding):
    """The oriented varifold: see :func:`meshot.varifold`.

    Parameters
    ----------
    n_supports : int, optional
        Number of faces drawn in every call. By default all faces are used.
    normal_scale : float
        The length of a scaled unit normal, in mm. With 0, the default of every encoding, normals are not compared. The
        paper uses 1 and states no unit.
    detach_weights : bool
        Whether to stop the gradient through the areas. By default, as in every encoding, it includes them.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    n_supports: int | None = None
    normal_scale: float = 0.0
    detach_weights: bool = False

    def __post_init__(self):
        _require_supports(self.n_supports)
        _require_bool(self.detach_weights)
        if not 0 <= self.normal_scale < math.inf:
            raise ValueError(f"normal_scale is {self.normal_scale!r}; a length >= 0 is needed, in mm")

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> DiscreteMeasure:
        """The varifold of all faces, or of the drawn ones."""
        if self.n_supports is None:
            return varifold(mesh, normal_scale=self.normal_scale, detach_weights=self.detach_weights)
        return varifold_sample(
            mesh, self.n_supports, generator, normal_scale=self.normal_scale, detach_weights=self.detach_weights
        )


@dataclasses.dataclass(frozen=True)
class SampleEncoding(Encoding):
    """Points drawn by area, without normals: see :func:`meshot.empirical`.

    Parameters
    ----------
    n_supports : int, optional
        Number of points drawn in every call. The default is the number of faces of the source.
    detach_weights : bool
        Whether to stop the gradient of the masses. By default it is stopped, as in most implementations.

    Raises
    ------
    ValueError
        If the number is not a positive integer, or ``detach_weights`` is not a bool.
    """

    n_supports: int | None = None
    detach_weights: bool = True

    def __post_init__(self):
        _require_supports(self.n_supports)
        _require_bool(self.detach_weights)

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> DiscreteMeasure:
        """The empirical measure."""
        return empirical(mesh, self.n_supports or n_default, generator, detach_weights=self.detach_weights)


@dataclasses.dataclass(frozen=True)
class SurfaceEncoding(Encoding):
    """The continuous surface, without normals: see :func:`meshot.surface`."""

    continuous: ClassVar[bool] = True

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> SurfaceMeasure:
        """The continuous measure. Nothing is random."""
        return surface(mesh)


def _require_bool(detach_weights: bool) -> None:
    if not isinstance(detach_weights, bool):
        raise ValueError(f"detach_weights is {detach_weights!r}; true or false is needed")


def _require_supports(n_supports: int | None) -> None:
    if n_supports is not None:
        require_positive_integer(n_supports, "n_supports")


#: The encodings by name.
ENCODINGS: dict[str, type[Encoding]] = {
    "varifold": VarifoldEncoding, "samples": SampleEncoding, "surface": SurfaceEncoding,
}  # fmt: skip


# Losses between two measures, selected by name, with their settings.


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
    """Partial transport along directions: see :func:`meshot.loss.sliced_partial`. Not in the paper.

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
    """Unbalanced transport along directions: see :func:`meshot.loss.sliced_unbalanced`. Not in the paper.

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


# Losses between two surfaces: a loss of measures applied to an encoding, and sums of such losses.

_VARIFOLD, _SLICED = VarifoldEncoding(), SlicedLoss()


@dataclasses.dataclass(frozen=True)
class SurfaceLoss:
    """A loss of measures applied to an encoding of both meshes.

    DDOT uses ``SurfaceLoss(VarifoldEncoding(normal_scale=1.0))``, and CortexODE uses ``SurfaceLoss(SampleEncoding(),
    ChamferLoss())``.

    Parameters
    ----------
    encoding : Encoding
        Maps each mesh to a measure.
    loss : MeasureLoss
        Compares the two measures.
    factor : float
        Factor on the loss. It has almost no effect with Adam, whose steps do not depend on the scale of the loss.

    Raises
    ------
    ValueError
        If the loss does not accept the encoding, or the factor is not positive.

    References
    ----------
    Le et al., ICLR 2024, Algorithm 1 and Table 3; Ma et al., *CortexODE*, IEEE TMI 2022.
    """

    encoding: Encoding = _VARIFOLD
    loss: MeasureLoss = _SLICED
    factor: float = 1.0

    def __post_init__(self):
        if self.encoding.continuous and not self.loss.takes_continuous:
            able = ", ".join(name for name, kind in LOSSES.items() if kind.takes_continuous)
            raise ValueError(f"{self.loss} does not accept {self.encoding}, which has no support points; {able} does")
        require_positive(self.factor, "factor")

    def __call__(self, source: Mesh, target: Mesh, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss between two meshes, times ``factor``. Random numbers are drawn from ``generator``."""
        n_default = len(source.faces)
        first, second = (self.encoding.measure(mesh, n_default, generator) for mesh in (source, target))
        return self.factor * self.loss(first, second, generator)

    def at(self, done: float) -> "SurfaceLoss":
        """The loss when this share of the steps of a training is done, in [0, 1]."""
        return dataclasses.replace(self, loss=self.loss.at(done))

    def settings(self) -> dict:
        """The settings as a flat mapping, in the format that :func:`surface_loss` reads."""
        names = {"loss": _name_of(LOSSES, self.loss), "encoding": _name_of(ENCODINGS, self.encoding)}
        return names | dataclasses.asdict(self.encoding) | dataclasses.asdict(self.loss) | {"factor": self.factor}


@dataclasses.dataclass(frozen=True)
class SummedLoss:
    """The sum of several losses between surfaces, each with its own encoding and factor.

    Parameters
    ----------
    terms : tuple of SurfaceLoss
        At least one.

    Raises
    ------
    ValueError
        If there is no term.
    """

    terms: tuple[SurfaceLoss, ...]

    def __post_init__(self):
        if not self.terms:
            raise ValueError("terms is empty; at least one loss is needed")

    def __call__(self, source: Mesh, target: Mesh, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The sum. The terms draw their random numbers one after the other."""
        return torch.stack([term(source, target, generator) for term in self.terms]).sum()

    def at(self, done: float) -> "SummedLoss":
        """The loss when this share of the steps of a training is done, in [0, 1]."""
        return SummedLoss(tuple(term.at(done) for term in self.terms))

    def settings(self) -> dict:
        """The settings of all terms, in the format that :func:`surface_loss` reads."""
        return {"terms": [term.settings() for term in self.terms]}


def surface_loss(settings: Mapping[str, object]) -> SurfaceLoss | SummedLoss:
    """Make a loss between surfaces from a mapping of settings, such as a section of a YAML file.

    Parameters
    ----------
    settings : mapping
        ``loss`` and ``encoding`` are names (default: sliced and varifold). The others are fields of these two, and
        ``factor``. None means that a setting is not given. Or only ``terms``, a list of such mappings: their sum.

    Raises
    ------
    ValueError
        If a name is unknown, a setting is not used by either part, or a value is invalid.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    if "terms" in given:
        return _summed(given)
    loss, encoding = str(given.pop("loss", "sliced")), str(given.pop("encoding", "varifold"))
    kinds = {"encoding": _kind_of(ENCODINGS, encoding, "encoding"), "loss": _kind_of(LOSSES, loss, "loss")}
    factor, parts = given.pop("factor", 1.0), {}
    for part, kind in kinds.items():
        own = _field_names(kind) & given.keys()
        parts[part] = kind(**{name: given.pop(name) for name in sorted(own)})
    if given:
        used = [field.name for kind in kinds.values() for field in dataclasses.fields(kind)]
        raise ValueError(
            f"{', '.join(given)} is set, which {loss} on {encoding} does not use; it uses "
            f"{', '.join([*used, 'factor'])}: leave the others out, or set them to null"
        )
    return SurfaceLoss(**parts, factor=factor)


def _summed(given: dict) -> SummedLoss:
    terms = given.pop("terms")
    if given:
        raise ValueError(f"{', '.join(given)} stands beside terms; write it into the term that it belongs to")
    if not isinstance(terms, Sequence) or not all(isinstance(term, Mapping) and "terms" not in term for term in terms):
        raise ValueError(f"terms is {terms!r}; a list of settings of losses is needed, such as [{{loss: chamfer}}]")
    return SummedLoss(tuple(surface_loss(term) for term in terms))


def loss_setting_names(loss: str | None = None, encoding: str | None = None) -> set[str]:
    """The settings that a loss and an encoding use. For a missing or unknown name, the settings of all of its kind."""
    kinds = [LOSSES[loss]] if loss in LOSSES else LOSSES.values()
    kinds = [*kinds, *([ENCODINGS[encoding]] if encoding in ENCODINGS else ENCODINGS.values())]
    return {"loss", "encoding", "factor", "terms"}.union(*(_field_names(kind) for kind in kinds))


def _field_names(kind: type) -> set[str]:
    return {field.name for field in dataclasses.fields(kind)}


def _kind_of(table: Mapping[str, type], name: str, what: str) -> type:
    require_choice(name, what, table)
    return table[name]


def _name_of(table: Mapping[str, type], part: object) -> str:
    return next(name for name, kind in table.items() if type(part) is kind)
