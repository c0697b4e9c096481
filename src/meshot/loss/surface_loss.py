"""A loss between two surfaces by name: which loss, on which encoding, in which units."""

import dataclasses
import math

import numpy as np
import torch

from meshot.errors import require_positive_integer
from meshot.loss.directions import random_directions
from meshot.loss.nearest import chamfer
from meshot.loss.sinkhorn import sinkhorn_divergence
from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.windowed import windowed_sliced_wasserstein
from meshot.measure import Measure, empirical, surface, varifold, varifold_sample
from meshot.mesh import Mesh
from meshot.types import Float, Tensor

LOSSES = ("sliced", "chamfer", "sinkhorn")
ENCODINGS = ("varifold", "samples", "surface")


@dataclasses.dataclass(frozen=True)
class SurfaceLoss:
    """A loss on an encoding.

    DDOT is ``SurfaceLoss(normal_scale=1.0)``, CortexODE ``SurfaceLoss("chamfer", "samples", factor=1000)``.

    Parameters
    ----------
    loss : str
        "sliced", "chamfer" or "sinkhorn".
    encoding : str
        "varifold", "samples" (points only) or "surface" (the continuous measure, for the sliced loss only).
    n_supports : int, optional
        So many faces (varifold) or points (samples) are drawn anew at every call, on both sides. If left out, the
        varifold has all faces, and there are as many samples as the source has faces.
    normal_scale : float
        The length of a unit normal in the varifold, in mm; at zero, the default of every encoding, normals are not
        compared. The paper gives none. Samples and the continuous surface are of positions only, whatever it is.
    detach_weights : bool
        Stop the gradient through the areas of the varifold. It always goes through those of the surface, and never
        through those of samples, as in CortexODE.
    n_directions : int
        Of the sliced loss, drawn anew at every call: L; in windows, for each of them.
    window : float, optional
        Take the sliced loss within windows of this radius, in mm, around places drawn on the target: see
        :func:`meshot.windowed_sliced_wasserstein`. If left out, as in the paper, there is one transport of everything.
    n_windows : int
        How many are drawn at every call.
    p : int
        The exponent: 1 or 2; of Chamfer always 2.
    blur : float
        Of Sinkhorn, in mm.
    factor : float
        What the loss is multiplied by. Adam hardly notices.

    Raises
    ------
    ValueError
        If a name is unknown, a number is outside its range, or the two names do not go together.

    References
    ----------
    Le et al., ICLR 2024, Algorithm 1 and Table 3; Ma et al., *CortexODE*, IEEE TMI 2022.
    """

    loss: str = "sliced"
    encoding: str = "varifold"
    n_supports: int | None = None
    normal_scale: float = 0.0
    detach_weights: bool = False
    n_directions: int = 100
    window: float | None = None
    n_windows: int = 32
    p: int = 2
    blur: float = 5.0
    factor: float = 1.0

    def __post_init__(self):
        for name, known in (("loss", LOSSES), ("encoding", ENCODINGS), ("p", (1, 2))):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {getattr(self, name)!r}; one of {', '.join(map(str, known))} is needed")
        if self.encoding == "surface" and (self.loss != "sliced" or self.n_supports is not None):
            raise ValueError(
                "the continuous surface has no supports: only the sliced loss, without n_supports, takes it"
            )
        if self.window is not None and (self.loss != "sliced" or self.encoding == "surface"):
            raise ValueError(
                f"window is {self.window!r}; only the sliced loss of the varifold or of samples is taken in windows"
            )
        if self.loss == "chamfer" and self.p != 2:
            raise ValueError(f"p is {self.p!r}; Chamfer squares its distances: 2 is needed")
        for name in ("n_directions", "n_windows", *(("n_supports",) if self.n_supports is not None else ())):
            object.__setattr__(self, name, require_positive_integer(getattr(self, name), name))
        for name in ("blur", "factor", *(("window",) if self.window is not None else ())):
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)!r}; a finite number > 0 is needed")
        if not 0 <= self.normal_scale < math.inf:
            raise ValueError(f"normal_scale is {self.normal_scale!r}; a length >= 0 is needed, in mm")

    def __call__(self, source: Mesh, target: Mesh, generator: np.random.Generator) -> Float[Tensor, ""]:
        """The loss between two meshes, times ``factor``; whatever is drawn is drawn from ``generator``."""
        n_samples = self.n_supports or len(source.faces)
        first, second = (self.measure(mesh, n_samples, generator) for mesh in (source, target))
        return self.factor * self._between(first, second, generator)

    def measure(self, mesh: Mesh, n_samples: int, generator: np.random.Generator) -> Measure:
        """The encoding of a mesh."""
        if self.encoding == "surface":
            return surface(mesh)
        if self.encoding == "samples":
            return empirical(mesh, n_samples, generator, detach_weights=True)
        if self.n_supports is None:
            return varifold(mesh, normal_scale=self.normal_scale, detach_weights=self.detach_weights)
        return varifold_sample(
            mesh, self.n_supports, generator, normal_scale=self.normal_scale, detach_weights=self.detach_weights
        )

    def _between(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        if self.loss == "chamfer":
            return chamfer(source, target)
        if self.loss == "sinkhorn":
            return sinkhorn_divergence(source, target, self.p, self.blur)
        if self.window is not None:
            return self._in_windows(source, target, generator)
        directions = random_directions(self.n_directions, source.places.shape[1], generator).to(source.places)
        return sliced_wasserstein(source, target, directions, self.p)

    def _in_windows(self, source: Measure, target: Measure, generator: np.random.Generator) -> Float[Tensor, ""]:
        """Around places drawn on the target by area, each with directions of its own."""
        d = source.places.shape[1]
        lines = random_directions(self.n_windows * self.n_directions, d, generator).to(source.places)
        shares = target.weights.double().cpu().numpy()
        drawn = generator.choice(len(shares), self.n_windows, p=shares / shares.sum())
        centres = target.places[torch.from_numpy(drawn).to(lines.device), :3]
        sets = lines.reshape(self.n_windows, self.n_directions, -1)
        return windowed_sliced_wasserstein(source, target, centres, self.window, sets, self.p)
