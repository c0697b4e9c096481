"""Cohorts as examples for systems: initial surfaces, made once and kept on disk, beside the true ones."""

import hashlib
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh, read_mesh, write_mesh
from meshot.model import SegmentationNetwork, network_digest
from meshot.pipeline.segmentation.segmenting import initial_surfaces
from meshot.pipeline.splits import scans_of
from meshot.synth.cohorts import Subject
from meshot.systems import Example, Scan, SurfaceKey
from meshot.volume import StandardScan


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
            As :func:`meshot.pipeline.segmentation.segment`; or if the network finds no white matter on a side.
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

    def example(self, subject: Subject, surfaces: Sequence[SurfaceKey], needs: Sequence[SurfaceKey]) -> Example:
        """One subject, with the true surfaces that are named and the initial ones that are needed.

        Raises
        ------
        ValueError
            If an initial surface other than the white one is needed, or the cohort has no such true surface.
        """
        standard = subject.standard()
        strange = [" ".join(key) for key in needs if key[1] != "white"]
        if strange:
            raise ValueError(f"initial surfaces are made of white matter; none is made of {', '.join(strange)}")
        initial = {key: self._of(subject, key[0], standard) for key in needs}
        image = standard.volume.with_data(standard.volume.data.astype(np.float32))
        targets = {key: subject.surface(key[1], key[0], "standard") for key in surfaces}
        return Example(f"{_cohort(subject)}/{subject.name}", Scan(image, initial), targets)

    def examples(
        self,
        cohorts: Sequence[str | os.PathLike],
        split: str,
        surfaces: Sequence[SurfaceKey],
        needs: Sequence[SurfaceKey],
        progress: Callable[[list], Iterable] = iter,
    ) -> list[Example]:
        """Every scan of a split, of one or more cohorts on disk.

        Parameters
        ----------
        cohorts : sequence of path
        split : str
            "train", "validation" or "test".
        surfaces, needs : sequence of keys
            True and initial surfaces: those of a system.
        progress : callable
            Wraps the list of scans, such as tqdm does.

        Raises
        ------
        ValueError
            If a folder is no cohort or none has a scan in the split.
        """
        return [self.example(subject, surfaces, needs) for subject in progress(scans_of(cohorts, split))]


def _cohort(subject: Subject) -> str:
    """What the folder of its cohort is called, also where it was given as ``.``."""
    return subject.cohort.absolute().name


def _scan_digest(scan: StandardScan) -> str:
    content = np.ascontiguousarray(scan.volume.data).tobytes() + scan.volume.affine.tobytes()
    return hashlib.sha256(content).hexdigest()[:12]
