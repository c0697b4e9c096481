"""A template: a fixed sphere on each side, of which a scale and an offset are learned."""

import torch

from meshot.loss import chamfer
from meshot.measure import varifold
from meshot.mesh import icosphere
from meshot.systems.common import Toy

SIDES = (("left", "white"), ("right", "white"))


class Placement(torch.nn.Module):
    """A scale and an offset for each side."""

    def __init__(self):
        super().__init__()
        self.scale = torch.nn.Parameter(torch.ones(2))
        self.offset = torch.nn.Parameter(torch.zeros(2, 3))

    def config(self):
        return {}

    def placed(self, k):
        ball = icosphere(2, 8.0, (20.0 * k - 10.0, 0.0, 0.0), dtype=torch.float32)
        return ball.with_vertices(ball.vertices * self.scale[k] + self.offset[k])


class System(Toy):
    """It ignores the image."""

    name, surfaces, networks = "template", SIDES, {"placement": Placement}

    @classmethod
    def train_parts(cls, examples, settings, run):
        def far(network, items):
            pairs = [(network.placed(k), item.targets[key]) for item in items for k, key in enumerate(SIDES)]
            return sum(chamfer(varifold(mesh), varifold(goal.to(torch.float32))) for mesh, goal in pairs)

        network = Placement()
        losses = (lambda: far(network, examples.training)), (lambda: far(network, examples.validation))
        return {"placement": cls.trained("placement", network, *losses, settings, run)}

    @torch.no_grad()
    def find_surfaces(self, scan):
        return {key: self.parts["placement"].network.placed(k) for k, key in enumerate(SIDES)}
