"""A head so simple that a network made by hand segments it: two balls, the right one brighter, in any position."""

import functools
from pathlib import Path

import numpy as np
import torch

from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import write_weights
from meshot.volume.registration import standard_scan
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume, transform_points

RADIUS = 32.0
CENTRES = {"left": (-38.0, -10.0, 8.0), "right": (38.0, -14.0, 10.0)}
BRIGHTNESS = {"left": 0.4, "right": 1.0}


def balls(to_template: np.ndarray) -> dict[str, Mesh]:
    """Both surfaces where a scanner sees them whose RAS leads to the template by this affine."""
    made = {}
    for side, centre in CENTRES.items():
        ball = icosphere(5, RADIUS, centre)
        made[side] = ball.with_vertices(transform_points(np.linalg.inv(to_template), ball.vertices))
    return made


def bright_head(affine: np.ndarray, shape: tuple[int, int, int], to_template: np.ndarray | None = None) -> Volume:
    """A scan of both on a grid."""
    grid = Volume(np.zeros(shape), affine)
    surfaces = balls(np.eye(4) if to_template is None else to_template)
    fractions = {side: enclosed_fractions(mesh, grid) for side, mesh in surfaces.items()}
    return grid.with_data(sum(BRIGHTNESS[side] * part for side, part in fractions.items()).astype(np.float32))


def bright_template(size: float = 4.0) -> Volume:
    """What heads are registered to."""
    affine = np.diag([size, size, size, 1.0])
    affine[:3, 3] = [-96, -90, -70]
    return bright_head(affine, tuple(int(n // size) for n in (192, 160, 160)))


@functools.cache
def _standard_brightness() -> tuple[float, float]:
    image = standard_scan(bright_template(), bright_template()).volume.data
    return float(image.mean()), float(image.std())


def brightness_network(scale: float = 100.0) -> SegmentationNetwork:
    """Tells left from right by how bright it is: background below .2, right above .5.

    Both convolutions hand on what they get, both normalisations take away the mean m of the image and divide by its
    deviation s, and the head undoes that: logits 0, k (I − .2), 2k (I − .2) − .3 k.
    """
    mean, deviation = _standard_brightness()
    network = SegmentationNetwork(width=1, depth=1)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
        for k in (0, 3):
            network.down[0][k].weight[0, 0, 1, 1, 1] = 1
            network.down[0][k + 1].weight.fill_(1)
            network.down[0][k + 1].bias.fill_(10)  # nothing is cut off by the rectifier
        at_zero = mean - 10 * deviation - 0.2
        network.head.weight[1:, 0, 1, 1, 1] = torch.tensor([scale * deviation, 2 * scale * deviation])
        network.head.bias[1:] = torch.tensor([scale * at_zero, 2 * scale * at_zero - 0.3 * scale])
    return network.eval()


def shifting_network(shift: tuple[float, float, float]) -> DeformationNetwork:
    """A flow that carries everything by the same way, in mm of the standard space."""
    network = DeformationNetwork(width=2, hidden=(3,), n_scales=1, size=3).float()
    with torch.no_grad():
        network.to_velocity.bias.copy_(torch.tensor(shift))
    return network


def write_bright_weights(folder: Path, shift: tuple[float, float, float] = (0.0, 0.0, 2.0)) -> Path:
    """The weights of these networks under the names that a reconstruction looks for."""
    folder.mkdir()
    write_weights(folder / "segmentation.safetensors", brightness_network(), {"command": "made by hand"})
    for side in CENTRES:
        write_weights(folder / f"{side}_white.safetensors", shifting_network(shift), {"command": "by <hand>"})
    return folder
