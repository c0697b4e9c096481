"""How points lie along a closed contour: do they reach all of it, how evenly, how far off it are they."""

import numpy as np

from meshot.mesh import Contour
from meshot.metrics import exact_transport
from meshot.types import Array, Float, Int, Tensor


def coverage(points: Float[Tensor, "n 2"], contour: Contour, radius: float | None = None) -> float:
    """The share of a contour's length that has a point within ``radius`` of it, in [0, 1].

    Parameters
    ----------
    points : tensor
        Anywhere in the plane; a point further than ``radius`` from the contour covers nothing.
    contour : Contour
        Closed, its edges in order.
    radius : float, optional
        In units of the points; by default one mean spacing, (length of the contour) / n. Then an even sample covers
        all, and an independent uniform one 1 − e⁻² = .865 on average, for large n away from corners: the floor to
        which a fit should be compared.

    Raises
    ------
    ValueError
        If there are no points, the contour is not one closed line, or the radius is not positive.

    Notes
    -----
    Exact: each edge meets each disc in one interval, and the union of intervals is measured. O(n E) memory.
    """
    places = _as_array(points)
    start, along, lengths = _edges(contour)
    radius = float(lengths.sum()) / len(places) if radius is None else radius
    if not radius > 0:
        raise ValueError(f"radius is {radius!r}; a number > 0 is needed, in units of the points")
    offset = places[None] - start[:, None]  # (E, n, 2)
    middle = np.einsum("end,ed->en", offset, along)
    half = np.sqrt(np.maximum(radius**2 - (np.square(offset).sum(axis=2) - middle**2), 0))
    low, high = np.clip(middle - half, 0, lengths[:, None]), np.clip(middle + half, 0, lengths[:, None])
    return sum(_union_length(a, b) for a, b in zip(low, high, strict=True)) / float(lengths.sum())


def evenness(points: Float[Tensor, "n 2"], contour: Contour) -> float:
    """How even the gaps between neighbours along the contour are: (Σ g)² / (n Σ g²), in [1/n, 1].

    Every point is moved to the nearest place on the contour; g are the n gaps in arc length between neighbours there,
    once around. Equal gaps give 1; all points in one place give 1/n. An independent uniform sample gives about ½: the
    mean of 1 / evenness is exactly 2n / (n + 1), because the gaps are those of a uniform sample on a circle. Equals
    1 / (1 + v²) with v the coefficient of variation of the gaps.

    Raises
    ------
    ValueError
        If there are no points, or the contour is not one closed line.
    """
    gaps = contour_gaps(points, contour)
    return float(gaps.sum() ** 2 / (len(gaps) * np.square(gaps).sum()))


def contour_gaps(points: Float[Tensor, "n 2"], contour: Contour) -> Float[Array, " n"]:
    """The arc lengths between neighbours along a closed contour, once around; they add up to its length."""
    edges, along_edge, _ = nearest_on_contour(points, contour)
    _, _, lengths = _edges(contour)
    positions = np.sort((np.cumsum(lengths) - lengths)[edges] + along_edge)
    return np.diff(positions, append=positions[0] + lengths.sum())


def nearest_on_contour(
    points: Float[Tensor, "n 2"], contour: Contour
) -> tuple[Int[Array, " n"], Float[Array, " n"], Float[Array, " n"]]:
    """For every point its nearest place on the contour: the edge, the arc length along that edge, and the distance."""
    places = _as_array(points)
    start, along, lengths = _edges(contour)
    offset = places[None] - start[:, None]
    foot = np.clip(np.einsum("end,ed->en", offset, along), 0, lengths[:, None])
    distance = np.linalg.norm(offset - foot[:, :, None] * along[:, None], axis=2)
    edges = distance.argmin(axis=0)
    each = np.arange(len(places))
    return edges, foot[edges, each], distance[edges, each]


def distance_to_contour(points: Float[Tensor, "n 2"], contour: Contour) -> float:
    """The mean distance of the points from the contour, in units of the points.

    Raises
    ------
    ValueError
        As :func:`evenness`.
    """
    return float(nearest_on_contour(points, contour)[2].mean())


def exact_distance(points: Float[Tensor, "n d"], others: Float[Tensor, "m d"]) -> float:
    """W₂ between two point sets of equal masses, by linear programming (POT), as a length in units of the points.

    Raises
    ------
    ValueError
        If a set is empty, the dimensions differ, or the solver does not finish.

    Notes
    -----
    About O(n³ log n) time, O(n m) memory; the transport is exact, not regularised.
    """
    source, target = _as_array(points), _as_array(others)
    if source.shape[1] != target.shape[1]:
        raise ValueError(f"points live in R^{source.shape[1]}, others in R^{target.shape[1]}; both must agree")
    return exact_transport(source, target)


def _as_array(points: Tensor) -> np.ndarray:
    places = points.detach().cpu().double().numpy()
    if places.ndim != 2 or len(places) == 0 or not np.isfinite(places).all():
        raise ValueError(f"points has shape {places.shape}; a finite, non-empty matrix is needed, one row per point")
    return places


def _edges(contour: Contour) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start, unit direction and length of every edge, after a check that they follow one another around."""
    edges = contour.edges.cpu().numpy()
    if not (edges[:, 1] == np.roll(edges[:, 0], -1)).all():
        raise ValueError("the edges of the contour do not follow one another once around: use closed_contour")
    corners = contour.vertices.detach().cpu().double().numpy()[edges]
    along = corners[:, 1] - corners[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    if not (lengths > 0).all():
        raise ValueError("the contour has an edge without length; remove its repeated vertex")
    return corners[:, 0], along / lengths[:, None], lengths


def _union_length(low: np.ndarray, high: np.ndarray) -> float:
    order = np.argsort(low)
    low, high = low[order], high[order]
    reached = np.maximum.accumulate(np.concatenate([[-np.inf], high[:-1]]))
    return float(np.maximum(high - np.maximum(low, reached), 0).sum())
