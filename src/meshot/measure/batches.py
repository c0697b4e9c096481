"""Batches of measures, and the pairs that a loss compares."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import torch

from meshot.errors import as_floating, as_indices, require_choice, require_finite, require_same_space
from meshot.measure.continuous import MeasureLike, as_measure, as_point_measure
from meshot.measure.discrete import Measure
from meshot.mesh import Contour, Mesh
from meshot.types import Array, Float, Int64, Tensor

#: What a loss of a batch returns: a value for every pair, or their mean.
REDUCTIONS = ("none", "mean")
_HALF = (torch.float16, torch.bfloat16)
_NEAR_ONE = 1e-5  # as for a single measure


class _Item(NamedTuple):
    """A measure of a batch that was validated as a whole."""

    places: Float[Tensor, "n d"]
    weights: Float[Tensor, " n"]
    cells: Tensor | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class MeasureBatch:
    """A batch of discrete measures in one array, padded to the same number of points.

    Every loss accepts it. A (B, n, d) array alone needs no such class: it means B clouds of n points of equal weight.

    Parameters
    ----------
    points : tensor or array
        The support points of all measures, of shape (B, n, d). Rows that are padding may have any finite value, or,
        beyond ``lengths``, any value.
    weights : tensor or array, optional
        The masses, of shape (B, n), non-negative, and with sum one in every row. Padding has the mass zero. They are
        converted to the dtype of the points, and divided by their sum if it is within 1e-5 of one.
    lengths : tensor or array of integers, optional
        Instead of weights: the number of points of every measure, which come first and have equal weight.

    Raises
    ------
    ValueError
        If the shapes do not fit, a number is NaN or infinite, a weight is negative, a row of weights does not sum to
        one, a length is not in [1, n], or both weights and lengths are given.

    Examples
    --------
    >>> import torch, meshot
    >>> clouds = meshot.MeasureBatch(torch.rand(2, 5, 3), lengths=torch.tensor([5, 3]))
    >>> clouds
    MeasureBatch(2 measures of up to 5 points in R^3, torch.float32)
    >>> meshot.chamfer(clouds, clouds).shape
    torch.Size([2])
    """

    points: Float[Tensor, "B n d"]
    weights: Float[Tensor, "B n"] | None = None
    lengths: Int64[Tensor, " B"] | None = None

    def __post_init__(self):
        points = _as_tensor(self.points, "points")
        if points.ndim != 3 or points.numel() == 0:
            raise ValueError(f"points has shape {tuple(points.shape)}; (B, n, d) is needed, none of them zero")
        lengths, weights, (n_measures, n_points, _) = self.lengths, self.weights, points.shape
        if lengths is not None:
            if weights is not None:
                raise ValueError("weights and lengths are both given; one of them is needed: put zeros into weights")
            lengths = as_indices(lengths, "lengths", n_points + 1)
            if lengths.shape != (n_measures,) or int(lengths.min()) < 1:
                raise ValueError(
                    f"lengths has shape {tuple(lengths.shape)} and the least entry {int(lengths.min())}; "
                    f"({n_measures},) numbers of points are needed, each at least 1"
                )
            inside = torch.arange(n_points, device=points.device) < lengths.to(points.device)[:, None]
            require_finite(points[inside], "points")
        else:
            require_finite(points, "points")
        if weights is not None:
            weights = _as_rows_of_masses(weights, points)
        for name, value in (("points", points), ("weights", weights), ("lengths", lengths)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def measures(self) -> list[Measure]:
        """The measures of the batch one by one, without copies."""
        clouds = self.points.unbind()
        if self.weights is not None:
            return [_Item(*each) for each in zip(clouds, self.weights.unbind(), strict=True)]
        counts = [len(cloud) for cloud in clouds] if self.lengths is None else self.lengths.tolist()
        equal = {count: self.points.new_full((count,), 1 / count) for count in set(counts)}
        return [_Item(cloud[:count], equal[count]) for cloud, count in zip(clouds, counts, strict=True)]

    def to(self, *args: object, **kwargs: object) -> "MeasureBatch":
        """The same measures in another dtype or on another device (arguments as ``torch.Tensor.to``).

        Raises
        ------
        ValueError
            If the dtype is not floating point.
        """
        weights = None if self.weights is None else self.weights.to(*args, **kwargs)
        return MeasureBatch(self.points.to(*args, **kwargs), weights, self.lengths)

    def __repr__(self) -> str:
        count, n, d = self.points.shape
        return f"MeasureBatch({count} measures of up to {n} points in R^{d}, {self.points.dtype})"


def _as_tensor(points: object, name: str) -> Tensor:
    """A floating-point tensor, float32 in place of half precision; entries may be NaN."""
    if isinstance(points, Tensor | np.ndarray) and torch.as_tensor(points).is_floating_point():
        points = torch.as_tensor(points)
    else:
        points = as_floating(points, name)
    return points.float() if points.dtype in _HALF else points


def _as_rows_of_masses(weights: object, points: Tensor) -> Float[Tensor, "B n"]:
    weights = as_floating(weights, "weights")
    if weights.shape != points.shape[:2] or weights.device != points.device:
        raise ValueError(
            f"weights has shape {tuple(weights.shape)} on {weights.device}; {tuple(points.shape[:2])} on "
            f"{points.device} is needed, one for each point"
        )
    if float(weights.detach().min()) < 0:
        raise ValueError(f"weights has a negative entry ({float(weights.detach().min()):.3g}); masses must be >= 0")
    near = 64 * torch.finfo(weights.dtype).eps if weights.dtype in _HALF else _NEAR_ONE
    weights = weights.to(points.dtype)
    totals, rounding = weights.detach().double().sum(dim=1), 64 * torch.finfo(weights.dtype).eps
    row = int((totals - 1).abs().argmax())
    if abs(float(totals[row]) - 1) > max(near, rounding):
        raise ValueError(
            f"row {row} of weights sums to {float(totals[row]):.9g}; a probability measure needs 1: divide by "
            "weights.sum(dim=1, keepdim=True)"
        )
    known = (totals - 1).abs() <= rounding
    return weights if bool(known.all()) else weights / torch.where(known, 1.0, totals).to(weights)[:, None]


# The two arguments of a loss as pairs of measures.

#: The types that a loss accepts for each of its two sides.
MeasuresLike = (
    MeasureLike | MeasureBatch | Float[Tensor, "_ _ _"] | Float[Array, "_ _ _"] | list[object] | tuple[object, ...]
)


class Pairs(NamedTuple):
    """The pairs of measures or meshes that a loss compares, and whether they came as a batch."""

    items: list[tuple]
    batched: bool
    reduction: str

    @property
    def like(self) -> Float[Tensor, "n d"]:
        """The points of the first measure, which has the dimension, dtype and device of all."""
        return self.items[0][0].places

    @property
    def continuous(self) -> bool:
        """Whether any of the measures is continuous."""
        return any(measure.cells is not None for pair in self.items for measure in pair)

    def reduced(self, values: Tensor | Sequence[Tensor]) -> Tensor:
        """The values of all pairs as the loss returns them: of the only pair, of all of them, or their mean."""
        values = values if isinstance(values, Tensor) else torch.stack(list(values))
        if not self.batched:
            return values[0]
        return values.mean(dim=0) if self.reduction == "mean" else values


def paired(source: object, target: object, reduction: str = "none") -> Pairs:
    """The pairs of two lists or tuples. What is not a list belongs to every pair.

    Raises
    ------
    ValueError
        If a list is empty, both have different lengths, or the reduction is unknown.
    """
    require_choice(reduction, "reduction", REDUCTIONS)
    lists = {name: v for name, v in (("source", source), ("target", target)) if isinstance(v, list | tuple)}
    for name, values in lists.items():
        if not values:
            raise ValueError(f"{name} is an empty list; at least one measure or mesh is needed")
    if len({len(values) for values in lists.values()}) > 1:
        raise ValueError(
            f"source holds {len(source)} measures and target {len(target)}; as many on both sides are needed, or a "
            "single one that belongs to every pair"
        )
    count = max((len(values) for values in lists.values()), default=1)
    sides = ([*value] if isinstance(value, list | tuple) else [value] * count for value in (source, target))
    return Pairs(list(zip(*sides, strict=True)), bool(lists), reduction)


def as_pairs(source: MeasuresLike, target: MeasuresLike, *, of_points: bool = False, reduction: str = "none") -> Pairs:
    """Convert both arguments of a loss to pairs of measures, each pair in the same space.

    A single measure is what :func:`meshot.measure.as_measures` makes of it, or with ``of_points``
    :func:`meshot.measure.as_point_measures`. A (B, n, d) array or tensor, a :class:`meshot.MeasureBatch`, and a list or
    tuple of measures, meshes or clouds are batches. A single measure beside a batch belongs to every pair. Half
    precision becomes float32.

    Raises
    ------
    ValueError
        If an argument is none of these, both are batches of different lengths, a pair is in different spaces, or the
        reduction is unknown.
    """
    convert = as_point_measure if of_points else as_measure
    pairs = paired(_measures(source, "source", convert), _measures(target, "target", convert), reduction)
    like = pairs.like
    for k, (one, other) in enumerate(pairs.items):
        require_same_space(one.places, other.places)
        if one.places.shape[1] != like.shape[1] or one.places.dtype != like.dtype or one.places.device != like.device:
            raise ValueError(
                f"pair {k} of the batch is in R^{one.places.shape[1]}, {one.places.dtype} on {one.places.device}, pair "
                f"0 in R^{like.shape[1]}, {like.dtype} on {like.device}; all must agree: encode all in the same way"
            )
    return pairs


def _measures(value: object, name: str, convert: Callable[[object, str], Measure]) -> list[Measure] | Measure:
    """The measures of one side: a list if they are a batch."""
    if isinstance(value, Tensor | np.ndarray) and value.ndim == 3:
        value = MeasureBatch(torch.as_tensor(value))
    if isinstance(value, MeasureBatch):
        return value.measures
    if isinstance(value, list | tuple) and value and not _is_one(value):
        return [convert(in_float(each), f"{name}[{k}]") for k, each in enumerate(value)]
    return convert(in_float(value), name)


def _is_one(value: Sequence) -> bool:
    """Whether a list or tuple is meant to be one cloud of numbers, or one mesh as vertices and faces."""
    arrays = [torch.as_tensor(each) for each in value if isinstance(each, Tensor | np.ndarray)]
    if len(value) == len(arrays) == 2 and arrays[0].is_floating_point() and not arrays[1].is_floating_point():
        return True
    return all(
        isinstance(each, list | tuple | int | float | np.number) or getattr(each, "ndim", 2) < 2 for each in value
    )


def in_float(value: object) -> object:
    """The same points, shape or measure in float32 if it is in half precision; anything else as it is."""
    if isinstance(value, np.ndarray) and value.dtype == np.float16:
        return value.astype(np.float32)
    if isinstance(value, Tensor):
        return value.float() if value.dtype in _HALF else value
    if isinstance(value, Mesh | Contour):
        return value.with_vertices(value.vertices.float()) if value.vertices.dtype in _HALF else value
    places = getattr(value, "places", None)
    if not isinstance(places, Tensor) or places.dtype not in _HALF:
        return value
    weights = value.weights.float()
    return _Item(places.float(), weights / weights.detach().sum(), value.cells)
