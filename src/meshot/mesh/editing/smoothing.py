"""Smoothing of meshes, for example of the voxel steps in a surface extracted from an image."""

import torch

from meshot.mesh.mesh import Mesh
from meshot.types import Float, Tensor


def neighbour_means(mesh: Mesh) -> Float[Tensor, "V 3"]:
    """The mean of the neighbours of every vertex, weighted by the number of faces that share the edge.

    A vertex without neighbours keeps its own position.
    """
    ends = mesh.faces
    source = torch.cat([ends, ends], dim=1).T.reshape(-1)
    other = torch.cat([ends.roll(1, dims=1), ends.roll(-1, dims=1)], dim=1).T.reshape(-1)
    total = torch.zeros_like(mesh.vertices).index_add(0, source, mesh.vertices[other])
    count = torch.zeros_like(mesh.vertices[:, 0]).index_add(0, source, torch.ones_like(mesh.vertices[other, 0]))
    return torch.where(count[:, None] > 0, total / count.clamp(min=1)[:, None], mesh.vertices)


def laplacian_smoothing(mesh: Mesh, n_steps: int, amount: float = 0.5) -> Mesh:
    """The mesh after ``n_steps`` steps that move each vertex towards the mean of its neighbours. The mesh shrinks.

    Parameters
    ----------
    mesh : Mesh
    n_steps : int
    amount : float
        Fraction of the way to the mean, in (0, 1].

    Raises
    ------
    ValueError
        If ``n_steps`` is negative or ``amount`` is outside (0, 1].
    """
    _require_steps(n_steps)
    if not 0 < amount <= 1:
        raise ValueError(f"amount is {amount!r}; a number in (0, 1] is needed, the part of the way to the neighbours")
    for _ in range(n_steps):
        mesh = mesh.with_vertices(torch.lerp(mesh.vertices, neighbour_means(mesh), amount))
    return mesh


def taubin_smoothing(mesh: Mesh, n_steps: int, amount: float = 0.5, pass_band: float = 0.1) -> Mesh:
    """The mesh after ``n_steps`` pairs of Laplacian steps, inwards and outwards, which limits shrinkage.

    Parameters
    ----------
    mesh : Mesh
    n_steps : int
    amount : float
        λ, the fraction of the way to the mean of the neighbours in the inward step, in (0, 1].
    pass_band : float
        k = 1/λ + 1/μ > 0: components of the shape with eigenvalues of the Laplacian below k are kept.

    Raises
    ------
    ValueError
        If ``n_steps`` is negative, ``amount`` is outside (0, 1], or ``pass_band`` is outside (0, 1/λ).

    References
    ----------
    Taubin, *A signal processing approach to fair surface design*, SIGGRAPH 1995.
    """
    _require_steps(n_steps)
    if not (0 < amount <= 1 and 0 < pass_band < 1 / amount):
        raise ValueError(
            f"amount is {amount!r} and pass_band {pass_band!r}; amount must lie in (0, 1], pass_band in (0, 1/amount)"
        )
    back = 1 / (pass_band - 1 / amount)
    for _ in range(n_steps):
        for step in (amount, back):
            mesh = mesh.with_vertices(torch.lerp(mesh.vertices, neighbour_means(mesh), step))
    return mesh


def _require_steps(n_steps: int) -> None:
    if isinstance(n_steps, bool) or not isinstance(n_steps, int) or n_steps < 0:
        raise ValueError(f"n_steps is {n_steps!r}; an integer >= 0 is needed")
