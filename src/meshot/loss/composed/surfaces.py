"""Losses between two surfaces: a loss of measures applied to an encoding, and sums of such losses."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import torch

from meshot.errors import require_choice, require_positive
from meshot.loss.composed.encodings import ENCODINGS, Encoding, VarifoldEncoding
from meshot.loss.composed.measure_losses import LOSSES, MeasureLoss, SlicedLoss
from meshot.mesh import Mesh
from meshot.types import Float, Tensor

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
