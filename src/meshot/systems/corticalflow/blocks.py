"""One block of CorticalFlow: a U-Net that gives a stationary velocity grid, and a chain of blocks that carry a mesh."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from meshot.anatomy import Hemisphere
from meshot.errors import require_positive_integer
from meshot.flow import integrate
from meshot.flow.fields import Velocity
from meshot.mesh import Mesh
from meshot.model import FeatureNetwork, sample_features
from meshot.rng import Generator
from meshot.systems.learning import Template, TemplateSettings
from meshot.types import Float, Tensor
from meshot.volume import Volume

INITIAL_FLOW = 1e-3  # standard deviation of the initial weights of the last layer


class FlowBlock(nn.Module):
    """A U-Net from a scan, and the velocity grids of the blocks before it, to a velocity grid.

    Parameters
    ----------
    side : str
        The hemisphere of the template.
    n_before : int
        Number of blocks before this one.
    width, depth, fold : int
        Of the U-Net: see :class:`meshot.model.FeatureNetwork`. The velocity grid has the grid of its first level.
    velocity_unit : float
        In mm per unit of time. The output of the last layer is multiplied by it.
    template : dict
        The settings of the template, see :class:`meshot.systems.learning.TemplateSettings`.
    box : tensor, optional
        The box of the template, in mm.
    generator : generator or int
        Source of the initial weights.

    Raises
    ------
    ValueError
        If a count or the unit is outside its range.
    """

    def __init__(
        self, side: Hemisphere, n_before: int = 0, width: int = 8, depth: int = 4, fold: int = 2,
        velocity_unit: float = 10.0, template: dict | None = None, box: Tensor | None = None, generator: Generator = 0,
    ):  # fmt: skip
        super().__init__()
        require_positive_integer(n_before + 1, "n_before + 1", 10)
        self.arguments = {"side": side, "n_before": n_before, "width": width, "depth": depth, "fold": fold}
        self.velocity_unit = float(velocity_unit)
        self.template = Template(side, TemplateSettings(**template or {}), box)
        self.features = FeatureNetwork(width, depth, fold, 3 * n_before, generator=generator)
        self.to_flow = nn.Conv3d(width, 3, 3, padding=1)
        draws = np.random.default_rng([n_before, width, depth]).standard_normal(tuple(self.to_flow.weight.shape))
        with torch.no_grad():
            self.to_flow.weight.copy_(INITIAL_FLOW * torch.from_numpy(draws))
            self.to_flow.bias.zero_()

    def config(self) -> dict:
        """The arguments that create a network of the same architecture."""
        template = {name: getattr(self.template.settings, name) for name in ("shape", "smoothing", "splits")}
        return self.arguments | {"velocity_unit": self.velocity_unit, "template": template}

    def forward(self, image: Float[Tensor, "1 1 x y z"], before: Tensor | None = None) -> Float[Tensor, "1 3 i j k"]:
        """The velocity grid, in units of ``velocity_unit``.

        Parameters
        ----------
        image : tensor
            See :func:`meshot.systems.learning.scaled_image`.
        before : tensor, optional
            The velocity grids of the blocks before, stacked as channels.
        """
        return self.to_flow(self.features(image, before)[-1])

    def velocity(self, grid: Float[Tensor, "1 3 i j k"], image: Volume) -> Velocity:
        """The velocity field of a grid, in mm per unit of time: trilinear, and constant beyond the border.

        Parameters
        ----------
        grid : tensor
            A result of :meth:`forward`.
        image : Volume
            The scan, whose affine places the grid.
        """
        return lambda _, points: self.velocity_unit * sample_features([grid], image, points)

    def carry(
        self, mesh: Mesh, image: Volume, values: Tensor, before: Tensor | None, n_steps: int, method: str
    ) -> tuple[Mesh, Tensor]:
        """A mesh after the flow of this block, and all velocity grids up to this one, stacked as channels.

        Parameters
        ----------
        mesh : Mesh
            In mm, in the dtype of the block.
        image : Volume
        values : tensor
            The same image as input of the network.
        before : tensor or None
            The grids of the blocks before.
        n_steps, method : int, str
            See :func:`meshot.integrate`.
        """
        grid = self(values, before)
        moved = mesh.with_vertices(integrate(self.velocity(grid, image), mesh.vertices, n_steps, method))
        return moved, grid if before is None else torch.cat([before, grid], dim=1)


def carried_through(
    blocks: Sequence[FlowBlock], mesh: Mesh, image: Volume, values: Tensor, n_steps: int, method: str
) -> tuple[Mesh, Tensor | None]:
    """A mesh after the flows of all blocks, one after the other, and their velocity grids: see :meth:`FlowBlock.carry`.

    Without a block, the mesh itself and None.
    """
    grids = None
    for block in blocks:
        mesh, grids = block.carry(mesh, image, values, grids, n_steps, method)
    return mesh, grids
