"""Losses between surfaces: an encoding combined with a loss of measures, both selected by name.

``ENCODINGS`` and ``LOSSES`` list the names. :func:`surface_loss` makes a :class:`SurfaceLoss` from a flat mapping of
settings, and raises an error for a setting that neither part uses.
"""

import abc
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
import torch

from meshot.errors import require_choice, require_positive
from meshot.loss.directions import random_directions
from meshot.loss.kernel_norm import ANGULAR, varifold_kernel
from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.transport import chamfer, sinkhorn_divergence
from meshot.loss.unbalanced import sliced_partial, sliced_unbalanced
from meshot.loss.windowed import drawn_windows, windowed_sliced_wasserstein
from meshot.measure import (
    DiscreteMeasure,
    Measure,
    MeasuresLike,
    SurfaceMeasure,
    as_pairs,
    empirical,
    in_float,
    paired,
    surface,
    varifold,
    varifold_sample,
)
from meshot.mesh import Mesh
from meshot.settings import Count, Length, Settings, Within, one_of
from meshot.types import Float, Tensor

# Encodings of a mesh as a measure, selected by name, with their settings.


class Encoding(Settings, abc.ABC):
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
    """

    n_supports: Count | None = None
    normal_scale: Annotated[float, Within(0, unit="mm")] = 0.0
    detach_weights: bool = False

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
    """

    n_supports: Count | None = None
    detach_weights: bool = True

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


#: The encodings by name.
ENCODINGS: dict[str, type[Encoding]] = {
    "varifold": VarifoldEncoding,
    "samples": SampleEncoding,
    "surface": SurfaceEncoding,
}


# Losses between two measures, selected by name, with their settings.

#: The exponent of a loss.
Exponent = Annotated[int, one_of((1, 2))]


class MeasureLoss(Settings, abc.ABC):
    """A loss between measures: a frozen dataclass whose fields are its settings.

    Both arguments may be lists, a batch, as in the losses that are called.

    Attributes
    ----------
    takes_continuous : bool
        Whether the loss accepts measures without support points.
    """

    takes_continuous: ClassVar[bool] = False

    @abc.abstractmethod
    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
        """The loss, or of two lists one value for each pair. Random numbers are drawn from ``generator``."""

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
    """

    takes_continuous: ClassVar[bool] = True
    n_directions: Count = 100
    p: Exponent = 2

    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
        """The loss along newly drawn directions, the same for every pair."""
        like = as_pairs(source, target).like
        directions = random_directions(self.n_directions, like.shape[1], generator).to(like)
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
    """

    window: Length = 6.0
    n_windows: Count = 32
    n_directions: Count = 100
    p: Exponent = 2
    last_window: Length | None = None

    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
        """The loss in newly drawn windows, each with its own directions."""
        targets = [other for _, other in as_pairs(source, target, of_points=True).items]
        drawn = [drawn_windows(other, self.n_windows, self.n_directions, generator) for other in targets]
        centres, sets = zip(*drawn, strict=True)
        return windowed_sliced_wasserstein(source, target, centres, self.window, sets, self.p)

    def at(self, done: float) -> "WindowedLoss":
        """The loss with the radius that belongs to this share of the steps, in [0, 1]."""
        factor = (self.last_window or self.window) / self.window
        return dataclasses.replace(self, window=self.window * factor**done)


@dataclasses.dataclass(frozen=True)
class ChamferLoss(MeasureLoss):
    """The Chamfer distance, squared: see :func:`meshot.chamfer`."""

    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
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
    """

    p: Exponent = 2
    blur: Length = 5.0
    scaling: Annotated[float, Within(0, 1, "()")] = 0.5

    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
        """The loss. Nothing is random."""
        return sinkhorn_divergence(source, target, self.p, self.blur, self.scaling)


@dataclasses.dataclass(frozen=True)
class VarifoldKernelLoss(MeasureLoss):
    """The kernel norm of varifolds: see :func:`meshot.loss.varifold_kernel`. Not in the paper."""

    width: Length = 5.0  # of the Gaussian in space, in mm
    angular: Annotated[str, one_of(ANGULAR)] = "oriented"  # the kernel of the normals: currents, varifold or oriented

    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
        """The loss. Nothing is random."""
        return varifold_kernel(source, target, self.width, self.angular)


@dataclasses.dataclass(frozen=True)
class SlicedPartialLoss(MeasureLoss):
    """Partial transport along directions: see :func:`meshot.loss.sliced_partial`. Not in the paper."""

    solve: ClassVar[Callable] = staticmethod(sliced_partial)
    reach: Length = 12.0  # the length beyond which nothing is transported along a direction, in mm
    n_directions: Count = 100  # number of directions, drawn in every call

    def __call__(
        self, source: MeasuresLike, target: MeasuresLike, generator: np.random.Generator
    ) -> Float[Tensor, "*B"]:
        """The loss along newly drawn directions, the same for every pair."""
        like = as_pairs(source, target).like
        directions = random_directions(self.n_directions, like.shape[1], generator).to(like)
        return self.solve(source, target, self.reach, directions)


@dataclasses.dataclass(frozen=True)
class SlicedUnbalancedLoss(SlicedPartialLoss):
    """Unbalanced transport along directions: see :func:`meshot.loss.sliced_unbalanced`. Not in the paper."""

    # The settings are those of partial transport; ``reach`` is twice the weight of the penalty.

    solve: ClassVar[Callable] = staticmethod(sliced_unbalanced)


#: The losses by name.
LOSSES: dict[str, type[MeasureLoss]] = {
    "sliced": SlicedLoss,
    "windowed": WindowedLoss,
    "chamfer": ChamferLoss,
    "sinkhorn": SinkhornLoss,
    "varifold_kernel": VarifoldKernelLoss,
    "sliced_partial": SlicedPartialLoss,
    "sliced_unbalanced": SlicedUnbalancedLoss,
}


# Losses between two surfaces: a loss of measures applied to an encoding, and sums of such losses.

_VARIFOLD, _SLICED = VarifoldEncoding(), SlicedLoss()
#: A mesh, or a batch of meshes.
Meshes = Mesh | list[Mesh] | tuple[Mesh, ...]


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

    def __call__(
        self, source: Meshes, target: Meshes, generator: np.random.Generator, *, reduction: str = "none"
    ) -> Float[Tensor, "*B"]:
        """The loss between two meshes, times ``factor``. Random numbers are drawn from ``generator``.

        Lists of meshes are batches, with a value for each pair, or their mean with ``reduction="mean"``. A single mesh
        beside a list belongs to every pair. Sampled points are drawn pair by pair, then directions for all of them.

        Raises
        ------
        ValueError
            If an argument is neither a mesh nor a list of meshes, or both lists have different lengths.
        """
        pairs, encoded = paired(source, target, reduction), []
        for k, pair in enumerate(pairs.items):
            for mesh, name in zip(pair, ("source", "target"), strict=True):
                if not isinstance(mesh, Mesh):
                    raise ValueError(
                        f"{name} of pair {k} is a {type(mesh).__name__}; a Mesh or a list of them is needed"
                    )
            n_default = len(pair[0].faces)
            encoded.append([self.encoding.measure(in_float(mesh), n_default, generator) for mesh in pair])
        if not pairs.batched:
            return self.factor * self.loss(*encoded[0], generator)
        sources, targets = map(list, zip(*encoded, strict=True))
        return self.factor * pairs.reduced(self.loss(sources, targets, generator))

    def at(self, done: float) -> "SurfaceLoss":
        """The loss when this share of the steps of a training is done, in [0, 1]."""
        return dataclasses.replace(self, loss=self.loss.at(done))

    def settings(self) -> dict:
        """The settings as a flat mapping, in the format that :func:`surface_loss` reads."""
        parts = (("loss", LOSSES, self.loss), ("encoding", ENCODINGS, self.encoding))
        names = {part: next(n for n, kind in table.items() if type(own) is kind) for part, table, own in parts}
        return names | self.encoding.as_dict() | self.loss.as_dict() | {"factor": self.factor}


@dataclasses.dataclass(frozen=True)
class SummedLoss:
    """The sum of several losses between surfaces, each with its own encoding and factor.

    Parameters
    ----------
    terms : tuple of SurfaceLoss
        At least one.
    """

    terms: tuple[SurfaceLoss, ...]

    def __post_init__(self):
        if not self.terms:
            raise ValueError("terms is empty; at least one loss is needed")

    def __call__(
        self, source: Meshes, target: Meshes, generator: np.random.Generator, *, reduction: str = "none"
    ) -> Float[Tensor, "*B"]:
        """The sum, for every pair of a batch. The terms draw their random numbers one after the other."""
        values = [term(source, target, generator, reduction=reduction) for term in self.terms]
        return torch.stack(values).sum(dim=0)

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
        terms = given.pop("terms")
        if given:
            raise ValueError(f"{', '.join(given)} stands beside terms; write it into the term that it belongs to")
        if not isinstance(terms, Sequence) or not all(isinstance(t, Mapping) and "terms" not in t for t in terms):
            raise ValueError(f"terms is {terms!r}; a list of settings of losses is needed, such as [{{loss: chamfer}}]")
        return SummedLoss(tuple(surface_loss(term) for term in terms))
    names = {"loss": str(given.pop("loss", "sliced")), "encoding": str(given.pop("encoding", "varifold"))}
    for part, table in (("encoding", ENCODINGS), ("loss", LOSSES)):
        require_choice(names[part], part, table)
    kinds = {"encoding": ENCODINGS[names["encoding"]], "loss": LOSSES[names["loss"]]}
    own = {part: {name: given.pop(name) for name in kind.kinds() if name in given} for part, kind in kinds.items()}
    factor = given.pop("factor", 1.0)
    if given:
        used = [name for kind in kinds.values() for name in kind.kinds()]
        raise ValueError(
            f"{', '.join(map(str, given))} is set, which {names['loss']} on {names['encoding']} does not use; it uses "
            f"{', '.join([*used, 'factor'])}: leave the others out, or set them to null"
        )
    return SurfaceLoss(**{part: kind.read(own[part], "") for part, kind in kinds.items()}, factor=factor)


def loss_setting_names(loss: str | None = None, encoding: str | None = None) -> set[str]:
    """The settings that a loss and an encoding use. For a missing or unknown name, the settings of all of its kind."""
    kinds = [LOSSES[loss]] if loss in LOSSES else LOSSES.values()
    kinds = [*kinds, *([ENCODINGS[encoding]] if encoding in ENCODINGS else ENCODINGS.values())]
    return {"loss", "encoding", "factor", "terms"}.union(*(kind.kinds() for kind in kinds))
