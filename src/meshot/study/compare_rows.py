"""All metrics of all pairs of two folders of surfaces, and their means with intervals over participants."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from meshot.mesh import read_mesh
from meshot.metrics import Evaluation, evaluate, rigidly_aligned
from meshot.statistics import mean_interval, paired_interval
from meshot.study.compare_files import Place

#: Sides of a summary: both means the average of the two sides of a participant.
SIDES = ("left", "right", "both")


class Compared(NamedTuple):
    """What a pair of surfaces scores, and the residue of its alignment (mm), None without one."""

    evaluation: Evaluation
    residue: float | None


def compared_pairs(
    pairs: Mapping[Place, tuple[Path, Path]],
    n_points: int = 100_000,
    seed: int = 0,
    n_emd_points: int = 5_000,
    progress: Callable[[Iterable], Iterable] = iter,
    align: bool = False,
) -> dict[Place, Compared]:
    """Evaluate every pair of surfaces, see :func:`meshot.evaluate`.

    Parameters
    ----------
    pairs : mapping
        Reconstructed and reference file, by participant, session and side.
    n_points, seed, n_emd_points : int
        As in :func:`meshot.evaluate`.
    progress : callable
        Wraps the pairs, as ``tqdm`` does.
    align : bool
        Whether each surface is first aligned with its reference, see :func:`meshot.metrics.rigidly_aligned`.

    Raises
    ------
    ValueError
        If two surfaces are in different spaces or a file cannot be read. The message names the subject.

    Warns
    -----
    UserWarning
        As :func:`meshot.evaluate`, with the name of the subject.
    """
    found = {}
    for place, paths in progress(pairs.items()):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                mesh, target = map(read_mesh, paths)
                aligned = rigidly_aligned(mesh, target, generator=seed) if align else None
                evaluation = evaluate(aligned.mesh if aligned else mesh, target, n_points, seed, n_emd_points)
                found[place] = Compared(evaluation, aligned.residue if aligned else None)
            except ValueError as error:
                raise ValueError(f"{place}: {error} (files {paths[0]} and {paths[1]})") from error
        for warning in said:
            warnings.warn(f"{place}: {warning.message}", warning.category, stacklevel=2)
    return found


def summary_rows(found: Mapping[Place, Compared]) -> list[dict]:
    """For each side and metric: the mean over participants, the mean floor, and their difference, with 95 % intervals.

    Sessions of a participant are averaged first, and for the side ``both`` also the two sides: a participant counts
    once. The difference is paired: value minus floor of the same participant. For distances it is what is more than
    sampling error; for area, volume and Euler number it is reconstructed minus reference. Intervals are Student's; with
    one participant they are None.

    Parameters
    ----------
    found : mapping
        As :func:`compared_pairs` returns it.
    """
    rows = []
    for side in SIDES:
        chosen = [place for place in found if side in (place.side, "both")]
        if not chosen or (side == "both" and len({place.side for place in chosen}) < 2):
            continue
        for name, metric in found[chosen[0]].evaluation.as_dict().items():
            values = _by_participant(found, chosen, name, "value")
            floors = _by_participant(found, chosen, name, "floor")
            rows.append(
                {
                    "side": side,
                    "metric": name,
                    "name": metric["name"],
                    "unit": metric["unit"],
                    "participants": len(values),
                }
                | _entries("mean", values, None)
                | {"floor": float(np.mean(floors))}
                | _entries("difference", values, floors)
            )
    return rows


def _by_participant(found: Mapping[Place, Compared], chosen: list[Place], name: str, key: str) -> list[float]:
    """The mean of a number over the sides of each session, and then over the sessions of each participant."""
    numbers: dict[str, dict[str, list[float]]] = {}
    for place in chosen:
        sessions = numbers.setdefault(place.participant, {})
        sessions.setdefault(place.session, []).append(getattr(getattr(found[place].evaluation, name), key))
    return [float(np.mean([np.mean(sides) for sides in sessions.values()])) for sessions in numbers.values()]


def _entries(name: str, values: list[float], floors: list[float] | None) -> dict[str, float | None]:
    if len(values) == 1:
        centre, low, high = values[0] - (floors[0] if floors else 0.0), None, None
    else:
        centre, low, high = mean_interval(values) if floors is None else paired_interval(values, floors)
    return {name: centre, f"{name}_low": low, f"{name}_high": high}
