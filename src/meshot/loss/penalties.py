"""Regularity penalties of meshes or contours, which do not depend on a target.

Each takes a single one, or a list as a batch. For a batch it returns one value for each, or with ``reduction="mean"``
their mean. Half precision is computed in float32, which is also the dtype of the value.
"""

import math
from collections.abc import Callable

import torch

from meshot.loss.autograd import uncompiled
from meshot.measure import in_float, paired
from meshot.mesh import (
    Contour,
    Mesh,
    cotangent_vectors,
    edge_lengths,
    edge_normals,
    face_normals,
    safe_norm,
    umbrella_vectors,
)
from meshot.types import Float, Tensor

#: A mesh or contour, or a batch of them.
Shapes = Mesh | Contour | list[Mesh | Contour] | tuple[Mesh | Contour, ...]


@uncompiled
def squared_edge_length(shape: Shapes, target_length: float = 0.0, *, reduction: str = "none") -> Float[Tensor, "*B"]:
    """The mean squared difference between the edge lengths and a target length, in squared units of the vertices.

    With target zero, shorter edges are better; on a closed contour of given length the sum is smallest if all edges
    have the same length. Same as PyTorch3D's ``mesh_edge_loss``. The gradient at an edge of length zero is zero. Each
    edge of a mesh counts once. The target is not negative, in units of the vertices.

    Raises
    ------
    ValueError
        If ``target_length`` is negative or not finite.
    """
    if not (math.isfinite(target_length) and target_length >= 0):
        raise ValueError(
            f"target_length is {target_length!r}; a finite number >= 0 is needed, in units of the vertices"
        )
    return _of_each(lambda one: (edge_lengths(one) - target_length).square().mean(), shape, reduction)


@uncompiled
def squared_laplacian(shape: Shapes, *, reduction: str = "none") -> Float[Tensor, "*B"]:
    """The mean squared distance between every vertex and the mean of its neighbours (uniform Laplacian).

    In squared units of the vertices, and smooth everywhere. :func:`meshot.loss.laplacian_length` is the
    mean of the distances themselves.

    Raises
    ------
    ValueError
        If a vertex has no neighbour.
    """
    return _of_each(lambda one: umbrella_vectors(one).square().sum(dim=1).mean(), shape, reduction)


@uncompiled
def laplacian_length(shape: Shapes, *, reduction: str = "none") -> Float[Tensor, "*B"]:
    """The mean distance between every vertex and the mean of its neighbours, in units of the vertices.

    Same as PyTorch3D's ``mesh_laplacian_smoothing`` with method "uniform", for one mesh. The gradient of a distance
    that is zero is zero.

    Raises
    ------
    ValueError
        If a vertex has no neighbour.

    References
    ----------
    Nealen et al., *Laplacian Mesh Optimization*, 2006.
    """
    return _of_each(lambda one: safe_norm(umbrella_vectors(one)).mean(), shape, reduction)


@uncompiled
def cotangent_laplacian_length(
    mesh: Mesh | list[Mesh] | tuple[Mesh, ...], detach_weights: bool = False, *, reduction: str = "none"
) -> Float[Tensor, "*B"]:
    """The mean distance between every vertex and the cotangent-weighted mean of its neighbours.

    In units of the vertices. Corresponds to PyTorch3D's ``mesh_laplacian_smoothing`` with method "cot", for one mesh.
    Unlike uniform weights, cotangent weights measure curvature and are little affected by tangential motion of
    vertices. There are two differences to PyTorch3D. The gradient includes the weights unless they are detached. A
    vertex whose faces all have zero area (only there do the weights sum to zero) counts with distance zero, so that the
    value does not depend on the origin. The gradient of a distance that is zero is zero. The mesh may be open; at its
    boundary the weighted means lie inside.

    Raises
    ------
    ValueError
        If a vertex belongs to no face.

    References
    ----------
    Pinkall and Polthier, 1993; Desbrun et al., *Implicit Fairing of Irregular Meshes*, SIGGRAPH 1999.
    """

    def of_one(mesh: Mesh) -> Float[Tensor, ""]:
        sums, totals = cotangent_vectors(mesh, detach_weights)
        positive = totals > 0
        means = sums / torch.where(positive, totals, torch.ones_like(totals))[:, None]
        return safe_norm(torch.where(positive[:, None], means, torch.zeros_like(means))).mean()

    return _of_each(of_one, mesh, reduction, (Mesh,))


@uncompiled
def normal_inconsistency(shape: Shapes, *, reduction: str = "none") -> Float[Tensor, "*B"]:
    """The mean of 1 − cos φ, where φ is the angle between the normals of neighbouring cells; in [0, 2].

    Neighbouring cells of a contour share a vertex, those of a mesh share an edge. If more than two faces share an edge,
    every pair counts; boundary edges do not count. Two faces with the same direction along their edge have opposite
    orientations, and one normal is reversed in the comparison. Same as PyTorch3D's ``mesh_normal_consistency``. A cell
    of zero size has no normal: its pairs count 1, without a gradient.

    Raises
    ------
    ValueError
        If a vertex of a contour is not the end of one edge and the start of one other, or no two faces of a mesh share
        an edge.
    """
    return _of_each(_inconsistency, shape, reduction)


def _inconsistency(shape: Mesh | Contour) -> Float[Tensor, ""]:
    if isinstance(shape, Contour):
        normals = edge_normals(shape)
        start, end = shape.edges.unbind(dim=1)
        every = torch.arange(len(shape.vertices), device=start.device)
        if not (torch.equal(start.sort().values, every) and torch.equal(end.sort().values, every)):
            raise ValueError(
                "a vertex of the contour does not have exactly one edge in and one edge out; normal consistency is "
                "defined on closed contours whose edges run one way round"
            )
        return (1 - (normals[end.argsort()] * normals[start.argsort()]).sum(dim=1)).mean()
    normals = face_normals(shape)
    # All pairs of faces that share an edge, with sign −1 if both have the same direction along it.
    n_vertices, n_faces = len(shape.vertices), len(shape.faces)
    sides = torch.stack([shape.faces, shape.faces.roll(-1, dims=1)], dim=2).reshape(-1, 2)
    keys, order = (sides.amin(dim=1) * n_vertices + sides.amax(dim=1)).sort(stable=True)
    rising = (sides[:, 0] < sides[:, 1])[order]
    owners = torch.arange(n_faces, device=keys.device).repeat_interleave(3)[order]
    firsts, seconds = [], []
    for apart in range(1, len(keys)):
        at = (keys[apart:] == keys[:-apart]).nonzero()[:, 0]
        if len(at) == 0:
            break
        firsts.append(at)
        seconds.append(at + apart)
    if not firsts:
        raise ValueError("no two faces of the mesh share an edge; normal consistency needs neighbours: merge vertices")
    first, second = torch.cat(firsts), torch.cat(seconds)
    sign = torch.where(rising[first] == rising[second], -1, 1).to(shape.vertices)
    return (1 - sign * (normals[owners[first]] * normals[owners[second]]).sum(dim=1)).mean()


def _of_each(
    penalty: Callable[[Mesh | Contour], Tensor],
    shapes: object,
    reduction: str,
    kinds: tuple[type, ...] = (Mesh, Contour),
) -> Float[Tensor, "*B"]:
    """The penalty of a single shape, or of every one in a list."""
    pairs = paired(shapes, None, reduction)
    for k, (shape, _) in enumerate(pairs.items):
        if not isinstance(shape, kinds):
            raise ValueError(
                f"shape {k} is a {type(shape).__name__}; a {' or '.join(each.__name__ for each in kinds)} is needed: "
                "mesh.with_vertices(points) gives points the faces of a mesh"
            )
    values = [penalty(in_float(shape)) for shape, _ in pairs.items]
    if len({(value.dtype, value.device) for value in values}) > 1:
        raise ValueError("the shapes of the batch differ in dtype or device; all must agree: use shape.to(...)")
    return pairs.reduced(values)
