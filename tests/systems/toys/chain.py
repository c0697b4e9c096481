"""A chain of two flows from an initial surface, trained one after the other: the second sees what the first leaves."""

import torch

from meshot.flow import integrate
from meshot.loss import chamfer
from meshot.measure import varifold
from meshot.systems.common import Toy

KEY = ("left", "white")


class Affine(torch.nn.Module):
    """A velocity that is affine in the position."""

    def __init__(self):
        super().__init__()
        self.slope = torch.nn.Parameter(torch.zeros(3, 3))
        self.shift = torch.nn.Parameter(torch.zeros(3))

    def config(self):
        return {}

    def carried(self, mesh):
        return mesh.with_vertices(integrate(lambda _, x: x @ self.slope / 10 + self.shift, mesh.vertices, 4))


class System(Toy):
    """Two affine flows."""

    name, surfaces, needs, networks = "chain", (KEY,), (KEY,), {"first": Affine, "second": Affine}

    @classmethod
    def train_parts(cls, examples, settings, run):
        def far(chain, items):
            found = 0
            for item in items:
                mesh = item.scan.initial[KEY].to(torch.float32)
                for network in chain:
                    mesh = network.carried(mesh)
                found = found + chamfer(varifold(mesh), varifold(item.targets[KEY].to(torch.float32)))
            return found

        parts, chain = {}, []
        for name in cls.networks:
            chain.append(Affine())
            losses = (lambda: far(chain, examples.training)), (lambda: far(chain, examples.validation))
            parts[name] = cls.trained(name, chain[-1], *losses, settings, run)
            chain[-1].requires_grad_(False)
        return parts

    @torch.no_grad()
    def find_surfaces(self, scan):
        mesh = scan.initial[KEY].to(torch.float32)
        for part in self.parts.values():
            mesh = part.network.carried(mesh)
        return {KEY: mesh}
