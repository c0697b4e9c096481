"""Sequences of flows applied one after another. Each may have its own field, step number and method."""

import dataclasses
from collections.abc import Sequence

import torch

from meshot.flow.crossings.guard import PathReport, inspect_paths
from meshot.flow.fields.field import Velocity, VelocityField
from meshot.flow.integration import integrate, trajectory
from meshot.types import Float, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class Leg:
    """One flow of a sequence: a field and its integration settings.

    Parameters
    ----------
    field : VelocityField, or callable of (time, points)
    n_steps, method
        As in :func:`meshot.integrate`.
    """

    field: VelocityField | Velocity
    n_steps: int = 12
    method: str = "euler"


def chain_end(legs: Sequence[Leg], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """Positions of the points after all flows, applied in order. Without flows, the points. Differentiable.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate`.
    """
    for leg in legs:
        points = integrate(leg.field, points, leg.n_steps, leg.method)
    return points


def chain_trajectory(legs: Sequence[Leg], points: Float[Tensor, "n d"]) -> Float[Tensor, "k n d"]:
    """Positions of the points before the first step of the first flow and after each step of each flow.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate`.
    """
    positions = points[None]
    for leg in legs:
        after = trajectory(leg.field, positions[-1], leg.n_steps, leg.method)[1:]
        positions = torch.cat([positions, after])
    return positions


def chain_reports(legs: Sequence[Leg], points: Float[Tensor, "n d"]) -> list[PathReport]:
    """The report of :func:`meshot.flow.crossings.inspect_paths` for every flow, along the paths of the points.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate`.
    """
    reports = []
    for leg in legs:
        reports.append(inspect_paths(leg.field, points, leg.n_steps, leg.method))
        points = reports[-1].positions[-1]
    return reports
