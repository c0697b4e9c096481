"""Training data of a deformation network: the initial and the true white surface of one hemisphere, and the scan."""

import dataclasses
import hashlib
from collections.abc import Sequence

import numpy as np
import torch

from meshot.anatomy import Hemisphere
from meshot.mesh import Mesh
from meshot.mesh.editing import simplified
from meshot.systems.examples import Example
from meshot.volume import Volume


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationExample:
    """One hemisphere of one subject in the standard space, with meshes and scan in float32.

    Parameters
    ----------
    name : str
    scan : Volume
        On the standard grid, in [0, 1].
    initial : Mesh
        The initial surface.
    coarse : Mesh
        The initial surface with fewer faces, for training.
    target : Mesh
        The true white surface.
    """

    name: str
    scan: Volume
    initial: Mesh
    coarse: Mesh
    target: Mesh


def hemisphere_example(example: Example, side: Hemisphere, n_faces: int) -> DeformationExample:
    """Make an example of one hemisphere for training or validation.

    Parameters
    ----------
    example : Example
        With an initial white surface of that side.
    side : str
    n_faces : int
        Number of faces of the coarse surface.
    """
    key, image = (side, "white"), example.scan.image
    initial = example.scan.initial[key]
    return DeformationExample(
        example.name,
        image.with_data(image.data.astype(np.float32)),
        initial.to(torch.float32),
        simplified(initial, n_faces).to(torch.float32),
        example.targets[key].to(torch.float32),
    )


def digest(examples: Sequence[DeformationExample]) -> str:
    """The SHA-256 of the names and values of all examples, in their order."""
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + item.scan.data.tobytes())
        for mesh in (item.initial, item.coarse, item.target):
            total.update(mesh.vertices.numpy().tobytes() + mesh.faces.numpy().tobytes())
    return total.hexdigest()
