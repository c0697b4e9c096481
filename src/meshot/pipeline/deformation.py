"""The flow of a trained network: from an initial surface to the surface that it finds in the image."""

import torch

from meshot.flow.integrate import integrate
from meshot.mesh.mesh import Mesh
from meshot.model.deformation import DeformationNetwork
from meshot.volume.volume import Volume

#: Steps of Euler's method, as in the paper.
N_STEPS = 10


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
        On the scale that the network learned with: the standard grid, in [0, 1].
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
        As :func:`meshot.integrate`; or if the flow leaves the numbers that are finite.
    """
    parameter = next(network.parameters())
    start = initial.vertices.to(parameter)
    # The displacement is rounded to the network's precision; the place it is added to is not.
    path = "visited" if start.device.type == "cpu" else "convolved"
    moved = integrate(network.velocity_in(image, path), start, n_steps, method) - start
    if not bool(torch.isfinite(moved).all()):
        raise ValueError("the flow leads to vertices that are not finite: is the network trained, the image in [0, 1]?")
    return initial.with_vertices(initial.vertices + moved.to(initial.vertices))
