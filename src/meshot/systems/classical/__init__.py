"""A classical system: threshold of a bias-corrected scan, genus 0, marching cubes, a move to the intensity gradient.

It plays the part of FreeSurfer in the consistency table, and is not FreeSurfer. The steps are of the same kind: bias
correction, a threshold between grey and white matter, filling, a correction of the topology, a tessellation, and a
deformable surface that looks for the steepest decrease of intensity. Each step here is far simpler: no skull
stripping, no atlas labels, no cutting of brainstem and callosum beyond a mean region, no control of distances between
neighbouring walls. The training estimates one threshold, and the mean white matter of its subjects, which says where
to look. No network is trained.

References: Dale, Fischl and Sereno, *Cortical surface-based analysis I*, NeuroImage 1999.
"""

from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh
from meshot.mesh.editing import taubin_smoothing
from meshot.systems.classical.atlas import Atlas, mean_fractions, misfit, whiteness
from meshot.systems.classical.surface import SurfaceSettings, moved_to_edges, thresholded_surface
from meshot.systems.examples import Example, ExampleSets, Scan, SurfaceKey
from meshot.systems.learning import LearningSettings, completed_groups, example_data, train_part
from meshot.systems.parts import Part
from meshot.systems.protocol import SurfaceSystem
from meshot.train import Groups, Progress
from meshot.types import Tensor
from meshot.volume.surfaces import enclosed_fractions

_GROUPS = {"surface": SurfaceSettings, "training": LearningSettings}
_KEYS = tuple((side, "white") for side in HEMISPHERES)


class System(SurfaceSystem):
    """The classical way to the white surfaces of both sides. Its only trained number is a threshold."""

    name = "classical"
    surfaces = _KEYS
    networks = {"atlas": Atlas}  # noqa: RUF012 (of the class, by the protocol)

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: the groups ``surface`` and ``training``."""
        return completed_groups(cls.name, settings, _GROUPS)

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Estimate the mean white matter and the threshold. Always on the processor."""
        surface, training = SurfaceSettings(**settings["surface"]), LearningSettings(**settings["training"])
        subjects = [([item.targets[key] for key in _KEYS], item.scan.image) for item in examples.training]
        fractions = mean_fractions(subjects, surface.reduction)
        atlas = Atlas(subjects[0][1].data.shape, surface.reduction, fractions)
        both = (examples.training, examples.validation)
        trained, kept = ([_samples(atlas, item, surface) for item in part] for part in both)

        def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
            return misfit(*trained[index], atlas.level)

        def validate() -> dict:
            return {"validation_loss": float(np.mean([float(misfit(*each, atlas.level.detach())) for each in kept]))}

        made_with = settings | {"data": example_data(examples, _KEYS)}
        place = None if folder is None else folder / "atlas"
        return {"atlas": train_part(atlas, training, examples, loss_of, validate, made_with, place, progress)}

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The surfaces at the steepest decrease of intensity near the threshold.

        Raises
        ------
        ValueError
            If the scan is on another grid than those of the training, or has no bright voxel in a region.
        """
        part = self.parts["atlas"]
        atlas, settings = part.network, SurfaceSettings(**part.record.get("surface", {}))
        allowed, deep = atlas.allowed(scan.image, settings.margin), atlas.deep(scan.image)
        white = whiteness(scan.image, deep.any(axis=0), settings.bias_width, settings.bias_rounds)
        level, found = float(atlas.level.detach()), {}
        for number, key in enumerate(_KEYS):
            mesh = thresholded_surface(white, level, allowed[number], deep[number], " ".join(key))
            found[key] = moved_to_edges(taubin_smoothing(mesh, settings.smoothing), white, level, settings)
        return found


def _samples(atlas: Atlas, item: Example, settings: SurfaceSettings) -> tuple[Tensor, Tensor]:
    """The whiteness of all voxels where white matter may lie, and the fractions that the true surfaces enclose."""
    image = item.scan.image
    allowed, deep = atlas.allowed(image, settings.margin).any(axis=0), atlas.deep(image).any(axis=0)
    white = whiteness(image, deep, settings.bias_width, settings.bias_rounds)
    truth = sum(enclosed_fractions(item.targets[key], image) for key in _KEYS)
    chosen = allowed & ~deep
    return tuple(torch.from_numpy(values[chosen].astype(np.float32)) for values in (white.data, truth))
