"""Rigid alignment of two surfaces of one subject, for example from two scans."""

import dataclasses
import math
import warnings

import numpy as np
import torch

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.metrics.distances import Surface
from meshot.rng import Generator
from meshot.types import Array, Float


@dataclasses.dataclass(frozen=True, eq=False)
class Alignment:
    """A surface after rigid alignment, and the remaining distance.

    Parameters
    ----------
    mesh : Mesh
        The source after the motion.
    rotation, translation : array
        x ↦ ``rotation`` x + ``translation``, in units of the vertices.
    residues : tuple of float
        The root mean squared distance from the source's points to the target's faces, before each step and after the
        last one. The last entry is the **residue** of the alignment.
    """

    mesh: Mesh
    rotation: Float[Array, "3 3"]
    translation: Float[Array, " 3"]
    residues: tuple[float, ...]

    @property
    def residue(self) -> float:
        """The last of ``residues``: the surfaces differ by it, or the iteration stopped early."""
        return self.residues[-1]

    @property
    def turn_degrees(self) -> float:
        """The angle of the rotation, in degrees."""
        sine = np.linalg.norm(self.rotation - self.rotation.T) / math.sqrt(8)
        return math.degrees(math.atan2(sine, (np.trace(self.rotation) - 1) / 2))


def rigidly_aligned(
    source: Mesh,
    target: Mesh,
    n_points: int = 20_000,
    generator: Generator = 0,
    max_steps: int = 100,
    tolerance: float = 1e-6,
) -> Alignment:
    """Align the source with the target by iterative closest points: rotation and translation, no scaling.

    Each step finds, for every one of ``n_points`` points of the source, the nearest point on the faces of the target.
    It then computes the motion that minimises the distances to the tangent planes there. If this motion increases the
    distance to the target, the step minimises the distances to the nearest points instead, which cannot increase it.
    The result is a local minimum. For a cortical surface the initial offset may be a few centimetres or about 20
    degrees, not more. The result depends on the random points by much less than the residue.

    Parameters
    ----------
    source, target : Mesh
        In the same space and unit. They should already overlap.
    n_points : int
        Number of points drawn on the source, uniformly by area.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator of these points; an integer is a seed.
    max_steps : int
        Maximum number of steps.
    tolerance : float
        The iteration stops when no point moves further than this in a step, in units of the vertices.

    Raises
    ------
    ValueError
        If a count is not a positive integer, the tolerance is not positive, or a mesh has zero area or is not finite.

    Warns
    -----
    UserWarning
        If the tolerance is not reached within ``max_steps`` steps.

    References
    ----------
    Besl and McKay, *A method for registration of 3-D shapes*, 1992; Chen and Medioni, *Object modelling by
    registration of multiple range images*, 1992.
    """
    require_positive_integer(max_steps, "max_steps")
    if not tolerance > 0:
        raise ValueError(f"tolerance is {tolerance!r}; a length > 0 is needed, in units of the vertices")
    goal, start = Surface(target), Surface(source).sample(n_points, generator).points
    points, residues = start, []
    nearest, normals = _feet(goal, points)
    for _ in range(max_steps):
        residues.append(_rms(points - nearest))
        moved = _apply(points, *_plane_step(points, nearest, normals))
        feet = _feet(goal, moved)
        if _rms(moved - feet[0]) > residues[-1]:
            moved = _apply(points, *_point_step(points, nearest))
            feet = _feet(goal, moved)
        step = float(np.linalg.norm(moved - points, axis=1).max())
        points, (nearest, normals) = moved, feet
        if step <= tolerance:
            break
    else:
        warnings.warn(f"the points still move by {step:.2g} after {max_steps} steps; allow more", stacklevel=2)
    rotation, translation = _point_step(start, points)
    vertices = source.vertices.detach().double().cpu().numpy() @ rotation.T + translation
    mesh = source.with_vertices(torch.from_numpy(vertices).to(source.vertices))
    return Alignment(mesh, rotation, translation, (*residues, _rms(points - nearest)))


def _feet(goal: Surface, points: Float[Array, "n 3"]) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    _, faces, nearest = goal.tree.squared_distance(goal.vertices, goal.faces, points)
    return nearest, goal.normals[faces]


def _rms(arrows: Float[Array, "n 3"]) -> float:
    return float(np.sqrt(np.square(arrows).sum(axis=1).mean()))


def _apply(points: Array, rotation: Array, translation: Array) -> Float[Array, "n 3"]:
    return points @ rotation.T + translation


def _plane_step(points: Array, nearest: Array, normals: Array) -> tuple[Float[Array, "3 3"], Float[Array, " 3"]]:
    """The small motion that minimises the distances of the points to the tangent planes at ``nearest``."""
    middle = points.mean(axis=0)
    rows = np.concatenate([np.cross(points - middle, normals), normals], axis=1)
    found = np.linalg.lstsq(rows, ((nearest - points) * normals).sum(axis=1), rcond=1e-9)[0]
    rotation = _turn(found[:3])
    return rotation, found[3:] + middle - rotation @ middle


def _turn(axis: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """The rotation about an axis by an angle equal to its length, in radians (Rodrigues)."""
    angle = float(np.linalg.norm(axis))
    if angle == 0:
        return np.eye(3)
    x, y, z = axis / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def _point_step(points: Array, nearest: Array) -> tuple[Float[Array, "3 3"], Float[Array, " 3"]]:
    """The motion that minimises the mean squared distance between paired points (Kabsch)."""
    middles = points.mean(axis=0), nearest.mean(axis=0)
    left, _, right = np.linalg.svd((nearest - middles[1]).T @ (points - middles[0]))
    sign = np.sign(np.linalg.det(left @ right))
    rotation = left @ np.diag([1, 1, sign]) @ right
    return rotation, middles[1] - rotation @ middles[0]
