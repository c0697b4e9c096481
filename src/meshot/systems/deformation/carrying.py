"""The flow of a trained network: from an initial surface to the surface that it finds in the image."""

import numpy as np
import torch

from meshot.flow import integrate
from meshot.mesh import Mesh
from meshot.model import N_STEPS, DeformationNetwork
from meshot.volume import Volume, sample_volume


def standardised(image: Volume, surface: Mesh) -> Volume:
    """An image with mean 0 and standard deviation 1 over the vertices of a surface, so that its border stands out.

    From 0 to 1 the border of white matter is a change by a twelfth around .6: a network hears the .6 first. Gain and
    offset of the scanner no longer matter.

    Parameters
    ----------
    image : Volume
    surface : Mesh
        In the space of the image.

    Raises
    ------
    ValueError
        If the image is constant over the surface: they may lie in different spaces.
    """
    values = sample_volume(image, surface.vertices.double())
    mean, spread = float(values.mean()), float(values.std())
    if not spread > 0:
        raise ValueError(
            f"the image is {mean:.4g} at every vertex of the surface; are both in the same space, and is the scan a T1?"
        )
    return image.with_data(((image.data - mean) / spread).astype(np.float32))


@torch.no_grad()
def deformed(
    initial: Mesh, image: Volume, network: DeformationNetwork, n_steps: int = N_STEPS, method: str = "euler"
) -> Mesh:
    """An initial surface carried by the flow that a network makes in an image.

    Parameters
    ----------
    initial : Mesh
        In the space of the image, in mm; any number of vertices, since the flow moves the whole space.
    image : Volume
        On the standard grid; its gain and offset do not matter, see
        :func:`meshot.systems.deformation.standardised`.
    network : DeformationNetwork
    n_steps, method : int, str
        See :func:`meshot.integrate`.

    Returns
    -------
    Mesh
        With the dtype and the device of ``initial``, and its faces.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate` and :func:`meshot.systems.deformation.standardised`; or if the flow leaves the
        numbers that are finite.
    """
    parameter = next(network.parameters())
    start = initial.vertices.to(parameter)
    # The displacement is rounded to the network's precision; the place it is added to is not.
    path = "visited" if start.device.type == "cpu" else "convolved"
    moved = integrate(network.velocity_in(standardised(image, initial), path), start, n_steps, method) - start
    if not bool(torch.isfinite(moved).all()):
        raise ValueError("the flow leads to vertices that are not finite: is the network trained?")
    return initial.with_vertices(initial.vertices + moved.to(initial.vertices))
