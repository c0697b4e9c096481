"""The losses of Vox2Cortex on a predicted mesh: Chamfer weighted by curvature, normals, and regularisers."""

import dataclasses

import numpy as np
import torch

from meshot.loss import nearest_neighbours
from meshot.loss.regularity import laplacian_length, normal_inconsistency, squared_edge_length
from meshot.mesh import Mesh, sample_locations
from meshot.mesh.geometry import face_normals, mean_curvatures
from meshot.types import Float, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class CurvedTarget:
    """A true surface with the unsigned mean curvature of its vertices (1/mm)."""

    mesh: Mesh
    curvatures: Float[Tensor, " v"]


def curved_target(mesh: Mesh) -> CurvedTarget:
    """A true surface in float32 with its curvatures."""
    mesh = mesh.to(torch.float32)
    return CurvedTarget(mesh, mean_curvatures(mesh).detach())


def chamfer_and_normals(
    found: Mesh, target: CurvedTarget, n_points: int, most: float, generator: np.random.Generator
) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """The Chamfer distance weighted by curvature (mm²), and the mean of 1 − |cosine| between the normals of its pairs.

    Every pair of nearest neighbours has the weight min(1 + κ, ``most``), where κ is the curvature of the target at its
    point of the pair. Both directions are means, and are added.

    Parameters
    ----------
    found : Mesh
    target : CurvedTarget
    n_points : int
        Number of random points on each surface.
    most : float
        The largest weight.
    generator : numpy.random.Generator

    Raises
    ------
    ValueError
        If a mesh has no area.

    References
    ----------
    Bongratz et al., *Vox2Cortex: fast explicit reconstruction of cortical surfaces from 3D MRI scans with geometric
    deep neural networks*, CVPR 2022.
    """
    points, normals, _ = _sampled(found, n_points, generator)
    truths, true_normals, corners = _sampled(target.mesh, n_points, generator)
    cells, barycentric = corners
    curvatures = (target.curvatures[target.mesh.faces[cells]] * barycentric).sum(dim=1)
    weights = (1 + curvatures).clamp(max=most)
    there, back = nearest_neighbours(points, truths), nearest_neighbours(truths, points)
    forward = (weights[there] * (points - truths[there]).square().sum(dim=1)).mean()
    backward = (weights * (truths - points[back]).square().sum(dim=1)).mean()
    cosines = (normals * true_normals[there]).sum(dim=1), (true_normals * normals[back]).sum(dim=1)
    return forward + backward, sum(1 - each.abs().mean() for each in cosines)


def _sampled(mesh: Mesh, n_points: int, generator: np.random.Generator) -> tuple[Tensor, Tensor, tuple[Tensor, Tensor]]:
    cells, barycentric = sample_locations(mesh, n_points, generator)
    points = (barycentric[:, :, None] * mesh.vertices[mesh.faces[cells]]).sum(dim=1)
    return points, face_normals(mesh)[cells], (cells, barycentric)


#: The factors by which the authors weigh terms of pial surfaces more than those of white ones.
PIAL = {"normals": 1.25, "laplacian": 2.5, "consistency": 2.25}


@dataclasses.dataclass(frozen=True)
class MeshWeights:
    """Weights of the terms of the loss on meshes, for lengths in units of ``extent`` mm, as in the paper.

    They are those of white surfaces. Those of pial surfaces follow from them, see :meth:`of`.

    Parameters
    ----------
    chamfer, normals, laplacian, consistency, edge : float
        Of the weighted Chamfer distance, the normals of its pairs, the length of the uniform Laplacian, the normals of
        neighbouring faces, and the mean squared edge length.
    most_curvature : float
        The largest weight of a pair in the Chamfer distance.
    extent : float
        In mm: half the longest side of the image in the paper.
    segmentation : float
        Of the loss of the segmentation.

    Raises
    ------
    ValueError
        If a number is negative, or ``extent`` is zero.
    """

    chamfer: float = 1.0
    normals: float = 0.01
    laplacian: float = 0.1
    consistency: float = 0.001
    edge: float = 5.0
    most_curvature: float = 5.0
    extent: float = 104.0
    segmentation: float = 1.0

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if not 0 <= value < float("inf") or (name == "extent" and value == 0):
                raise ValueError(f"{name} is {value!r}; a finite number >= 0 is needed, and > 0 for extent")

    def of(self, kind: str) -> "MeshWeights":
        """The weights for a kind of surface, "white" or "pial"."""
        more = PIAL if kind == "pial" else {}
        return dataclasses.replace(self, **{name: factor * getattr(self, name) for name, factor in more.items()})

    def mesh_loss(
        self, found: Mesh, target: CurvedTarget, n_points: int, generator: np.random.Generator
    ) -> Float[Tensor, ""]:
        """The weighted sum of all terms for one mesh."""
        chamfer, normals = chamfer_and_normals(found, target, n_points, self.most_curvature, generator)
        return (
            (self.chamfer * chamfer + self.edge * squared_edge_length(found)) / self.extent**2
            + self.laplacian * laplacian_length(found) / self.extent
            + self.normals * normals
            + self.consistency * normal_inconsistency(found)
        )
