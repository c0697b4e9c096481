"""What the deformation network learns from: initial surfaces, made once and kept on disk, beside the true ones."""

import dataclasses
import hashlib
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh, read_mesh, write_mesh
from meshot.mesh.editing import simplified
from meshot.model import SegmentationNetwork, network_digest
from meshot.pipeline.segmentation.segmenting import initial_surfaces
from meshot.pipeline.splits import scans_of
from meshot.synth.cohorts import Subject
from meshot.volume import StandardScan, Volume


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationExample:
    """One hemisphere of one subject in the standard space; meshes and scan in float32.

    Parameters
    ----------
    name : str
    scan : Volume
        On the standard grid, in [0, 1].
    initial : Mesh
        Where the flow starts.
    coarse : Mesh
        The same with fewer faces, for training.
    target : Mesh
        The true white surface.
    """

    name: str
    scan: Volume
    initial: Mesh
    coarse: Mesh
    target: Mesh


class InitialSurfaces:
    """Initial surfaces of subjects, in a folder: each is made when it is first asked for.

    What is kept is found again by the weights of the network and by the scan, whatever the cohort is called. It does
    not know the code that made it: empty the folder where that changes.

    Parameters
    ----------
    folder : path
    network : SegmentationNetwork
    """

    def __init__(self, folder: str | os.PathLike, network: SegmentationNetwork):
        self.folder = Path(folder) / f"segmentation-{network_digest(network)[:12]}"
        self.network = network

    def of(self, subject: Subject, side: Hemisphere) -> Mesh:
        """The initial white surface of one side, in the standard space, in mm.

        Raises
        ------
        ValueError
            As :func:`meshot.pipeline.segmentation.segmenting.initial_surfaces`.
        """
        return self._of(subject, side, subject.standard())

    def _of(self, subject: Subject, side: Hemisphere, scan: StandardScan) -> Mesh:
        paths = {s: self.path(subject, s, scan) for s in HEMISPHERES}
        if not paths[side].is_file():
            for name, found in initial_surfaces(scan, self.network).items():
                if not paths[name].is_file():  # another training may have read it
                    write_mesh(paths[name], found.mesh)
        return read_mesh(paths[side])

    def path(self, subject: Subject, side: Hemisphere, scan: StandardScan) -> Path:
        """Where the initial surface of one side is kept."""
        return self.folder / _cohort(subject) / f"{subject.name}_{_scan_digest(scan)}_{side}.surf.gii"

    def example(self, subject: Subject, side: Hemisphere, n_faces: int) -> DeformationExample:
        """One hemisphere, ready for training or validation."""
        standard = subject.standard()
        initial, scan = self._of(subject, side, standard), standard.volume
        return DeformationExample(
            f"{_cohort(subject)}/{subject.name}",
            scan.with_data(scan.data.astype("float32")),
            initial.to(torch.float32),
            simplified(initial, n_faces).to(torch.float32),
            subject.surface("white", side, "standard").to(torch.float32),
        )

    def examples(
        self,
        cohorts: Sequence[str | os.PathLike],
        split: str,
        side: Hemisphere,
        n_faces: int,
        progress: Callable[[list], Iterable] = iter,
    ) -> list[DeformationExample]:
        """Every scan of a split, of one or more cohorts on disk.

        Parameters
        ----------
        cohorts : sequence of path
        split : str
            "train", "validation" or "test".
        side : str
        n_faces : int
            Of the coarse surfaces.
        progress : callable
            Wraps the list of scans, such as tqdm does.

        Raises
        ------
        ValueError
            If a folder is no cohort or none has a scan in the split.
        """
        return [self.example(subject, side, n_faces) for subject in progress(scans_of(cohorts, split))]


def _cohort(subject: Subject) -> str:
    """What the folder of its cohort is called, also where it was given as ``.``."""
    return subject.cohort.absolute().name


def _scan_digest(scan: StandardScan) -> str:
    content = np.ascontiguousarray(scan.volume.data).tobytes() + scan.volume.affine.tobytes()
    return hashlib.sha256(content).hexdigest()[:12]


def digest(examples: Sequence[DeformationExample]) -> str:
    """SHA-256 of the names and values of all examples, in their order."""
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + item.scan.data.tobytes())
        for mesh in (item.initial, item.coarse, item.target):
            total.update(mesh.vertices.numpy().tobytes() + mesh.faces.numpy().tobytes())
    return total.hexdigest()
