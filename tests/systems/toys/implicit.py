"""An implicit surface: a threshold of the image is learned, and the surface is where the image takes that value."""

import torch

from meshot.systems.common import Toy
from meshot.volume import enclosed_fractions, isosurface

KEY = ("left", "white")


class Threshold(torch.nn.Module):
    """One number."""

    def __init__(self):
        super().__init__()
        self.fifths = torch.nn.Parameter(torch.tensor(1.5))

    @property
    def value(self):
        return self.fifths / 5

    def config(self):
        return {}


def left(scan):
    """The image without its right half."""
    data = scan.image.data.copy()
    data[len(data) // 2 :] = data.min()
    return scan.image.with_data(data)


class System(Toy):
    """The left white surface, wherever the image is bright."""

    name, surfaces, networks = "implicit", (KEY,), {"threshold": Threshold}

    @classmethod
    def train_parts(cls, examples, settings, run):
        def wrong(network, items):
            found = [torch.sigmoid(20 * (torch.from_numpy(left(item.scan).data) - network.value)) for item in items]
            truths = [torch.from_numpy(enclosed_fractions(item.targets[KEY], item.scan.image)) for item in items]
            return sum((one - other).square().mean() for one, other in zip(found, truths, strict=True))

        network = Threshold()
        losses = (lambda: wrong(network, examples.training)), (lambda: wrong(network, examples.validation))
        return {"threshold": cls.trained("threshold", network, *losses, settings, run)}

    def find_surfaces(self, scan):
        return {KEY: isosurface(left(scan), float(self.parts["threshold"].network.value.detach()))}
