"""Template surfaces: one smooth closed shape, placed in the mean box of the training surfaces, and what it becomes."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Literal

import torch
from torch import nn

from meshot.anatomy import Hemisphere, fsaverage5_surface
from meshot.errors import require_choice
from meshot.mesh import Mesh
from meshot.mesh.editing import laplacian_smoothing
from meshot.mesh.shapes import icosphere, split_in_four
from meshot.systems.learning.surfaces import SURFACES, checked_surfaces
from meshot.types import Float, Tensor

SHAPES = ("fsaverage5", "sphere")
MOST_SMOOTHING, MOST_SPLITS = 2000, 3


@dataclasses.dataclass(frozen=True)
class TemplateSettings:
    """The shape of a template, and the surfaces that it becomes.

    Parameters
    ----------
    shape : str
        "fsaverage5": FreeSurfer's average white surface of other people, smoothed until its folds are gone. "sphere":
        an ellipsoid. Both have 10 242 vertices.
    smoothing : int
        Number of Laplacian steps on fsaverage5. After 200 steps the surface is a smooth hull of the hemisphere.
    splits : int
        How often every face is divided into four.
    surfaces : sequence of str
        The surfaces of each side that are found: [white], or [white, pial].

    Raises
    ------
    ValueError
        If the shape or the surfaces are unknown, or a count is outside its range.
    """

    shape: Literal["fsaverage5", "sphere"] = "fsaverage5"
    smoothing: int = 200
    splits: int = 0
    surfaces: Sequence[str] = SURFACES[0]

    def __post_init__(self):
        require_choice(self.shape, "shape", SHAPES)
        object.__setattr__(self, "surfaces", checked_surfaces(self.surfaces))
        for name, most in (("smoothing", MOST_SMOOTHING), ("splits", MOST_SPLITS)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
                raise ValueError(f"{name} is {value!r}; an integer from 0 to {most} is needed")


class Template(nn.Module):
    """A template in its position. Its box is a buffer, so that it is stored with the weights of the network.

    The box is the only property of training subjects that a template has. It is the mean of theirs, see
    :func:`meshot.systems.learning.mean_box`. No subject of a test contributes to it.

    Parameters
    ----------
    side : str
        The hemisphere whose shape is used.
    settings : TemplateSettings
    box : tensor, optional
        The lower and the upper corner, in mm. By default the unit cube, until weights are loaded.
    """

    def __init__(self, side: Hemisphere, settings: TemplateSettings, box: Float[Tensor, "2 3"] | None = None):
        super().__init__()
        self.side, self.settings = side, settings
        box = torch.tensor([[0.0] * 3, [1.0] * 3]) if box is None else box
        self.register_buffer("box", box.float())

    def mesh(self) -> Mesh:
        """The template in mm, in float32: its bounding box is the box."""
        shape = template_shape(self.side, self.settings)
        low, high = shape.vertices.amin(dim=0), shape.vertices.amax(dim=0)
        lower, upper = self.box.double().cpu()
        return shape.with_vertices(lower + (shape.vertices - low) / (high - low) * (upper - lower)).to(torch.float32)


@functools.lru_cache(maxsize=8)
def template_shape(side: Hemisphere, settings: TemplateSettings) -> Mesh:
    """The shape of a template, before it is placed in its box."""
    if settings.shape == "sphere":
        return icosphere(5 + settings.splits)
    mesh = laplacian_smoothing(fsaverage5_surface("white", side), settings.smoothing)
    for _ in range(settings.splits):
        mesh = Mesh(*split_in_four(mesh.vertices, mesh.faces))
    return mesh


def mean_box(surfaces: Sequence[Mesh]) -> Float[Tensor, "2 3"]:
    """The mean of the bounding boxes of surfaces: the lower and the upper corner, in float32."""
    corners = [torch.stack([mesh.vertices.amin(dim=0), mesh.vertices.amax(dim=0)]).double() for mesh in surfaces]
    return torch.stack(corners).mean(dim=0).float()
