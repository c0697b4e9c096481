"""Targets and initial meshes. The chapter reads the file of meshes through this module."""

import math

import numpy as np
import torch

from meshot import Mesh
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import folded_sphere, icosphere, laplacian_smoothing, signed_volume, smooth_crossings
from meshot_book.notebook import read_meshes as read_meshes, write_meshes as write_meshes


def target_mesh(target: str, seed: int, config: dict) -> Mesh:
    """A member of the analytic family (stretched and rotated by the seed), or fsaverage5's white surface, repaired."""
    if target != "folded":
        return smooth_crossings(fsaverage5_surface("white", target.removeprefix("fsaverage5_")))
    shape = config["folded"]
    generator = np.random.default_rng([seed, 0])
    stretch = 1 + shape["stretch"] * generator.uniform(-1, 1, 3)
    turn = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    folded = folded_sphere(shape["subdivisions"], shape["radius"], shape["depth"], shape["n_folds"])
    return folded.with_vertices(folded.vertices @ torch.from_numpy(np.diag(stretch) @ turn.T))


def start_mesh(start: str, target: str, goal: Mesh, config: dict) -> Mesh:
    """A sphere of the target's volume around the mean of its vertices, or the smoothed target, with as many faces."""
    if start == "smoothed":
        return laplacian_smoothing(goal, config["targets"][target]["smoothing"])
    radius = (3 * float(signed_volume(goal)) / (4 * math.pi)) ** (1 / 3)
    subdivisions = round(math.log(len(goal.faces) / 20, 4))
    return icosphere(subdivisions, radius, tuple(goal.vertices.mean(dim=0).tolist()))
