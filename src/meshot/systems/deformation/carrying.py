"""Application of a trained network: deformation of an initial surface by the flow."""

import numpy as np
import torch

from meshot.flow import integrate
from meshot.mesh import Mesh
from meshot.model import N_STEPS, DeformationNetwork, ImageVelocity
from meshot.volume import Volume, sample_volume


def standardised(image: Volume, surface: Mesh) -> Volume:
    """An image scaled to mean 0 and standard deviation 1 over the vertices of a surface.

    In an image scaled to [0, 1], the border of white matter is a change of about 1/12 around a value of .6, which is
    small compared with the mean. Standardising removes the mean, and also gain and offset of the scanner.

    Parameters
    ----------
    image : Volume
    surface : Mesh
        In the space of the image.

    Raises
    ------
    ValueError
        If the image is constant over the surface, for example because they are in different spaces.
    """
    values = sample_volume(image, surface.vertices.double())
    mean, spread = float(values.mean()), float(values.std())
    if not spread > 0:
        raise ValueError(
            f"the image is {mean:.4g} at every vertex of the surface; are both in the same space, and is the scan a T1?"
        )
    return image.with_data(((image.data - mean) / spread).astype(np.float32))


def velocity_field(network: DeformationNetwork, image: Volume, surface: Mesh) -> ImageVelocity:
    """The velocity field of a network in an image that is standardised over a surface.

    It follows the network when its weights change.
    """
    path = "visited" if next(network.parameters()).device.type == "cpu" else "cut"
    return network.velocity_in(standardised(image, surface), path)


@torch.no_grad()
def deformed(
    initial: Mesh,
    image: Volume,
    network: DeformationNetwork,
    n_steps: int = N_STEPS,
    method: str = "euler",
    standard: Mesh | None = None,
) -> Mesh:
    """Deform an initial surface by the flow of a network in an image.

    Parameters
    ----------
    initial : Mesh
        In the space of the image, in mm. It may have any number of vertices, since the flow is defined everywhere.
    image : Volume
        On the standard grid. Its gain and offset do not matter, see :func:`meshot.systems.deformation.standardised`.
    network : DeformationNetwork
    n_steps, method : int, str
        See :func:`meshot.integrate`.
    standard : Mesh, optional
        The image is standardised over the vertices of this surface, by default those of ``initial``. For the coarse
        surface of a training it is the whole initial surface, as in the training.

    Returns
    -------
    Mesh
        With the faces, dtype and device of ``initial``.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate` and :func:`meshot.systems.deformation.standardised`; or if the flow gives positions
        that are not finite.
    """
    parameter = next(network.parameters())
    start = initial.vertices.to(parameter)
    # Only the displacement is rounded to the network's precision, not the initial position.
    field = velocity_field(network, image, initial if standard is None else standard)
    moved = integrate(field, start, n_steps, method) - start
    if not bool(torch.isfinite(moved).all()):
        raise ValueError("the flow leads to vertices that are not finite: is the network trained?")
    return initial.with_vertices(initial.vertices + moved.to(initial.vertices))
