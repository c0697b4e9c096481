"""Moments of the solid that a closed mesh encloses."""

import torch

from meshot.mesh.mesh import Mesh
from meshot.types import Float, Tensor


def solid_moments(mesh: Mesh) -> tuple[Float[Tensor, ""], Float[Tensor, " 3"], Float[Tensor, "3 3"]]:
    """Volume, mean and covariance of the uniform mass inside a closed mesh with outward normals.

    The integrals over the solid are sums over the tetrahedra between the faces and one point.

    Raises
    ------
    ValueError
        If the enclosed volume is not positive.
    """
    origin = mesh.vertices.mean(dim=0)
    corners = (mesh.vertices - origin)[mesh.faces]
    sixfold = torch.linalg.det(corners)
    volume = sixfold.sum() / 6
    if not volume > 0:
        raise ValueError(f"the mesh encloses {float(volume):.4g}; a closed mesh with outward normals is needed")
    sums = corners.sum(dim=1)
    mean = (sixfold[:, None] * sums).sum(dim=0) / (24 * volume)
    products = torch.einsum("f,fi,fj->ij", sixfold, sums, sums)
    products = products + torch.einsum("f,fci,fcj->ij", sixfold, corners, corners)
    return volume, mean + origin, products / (120 * volume) - torch.outer(mean, mean)
