"""Training examples from cohorts: scans, true surfaces, and initial surfaces, which are stored on disk."""

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
    """Initial surfaces of subjects, stored in a folder and computed on first use.

    A stored surface is identified by the weights of the network and by the scan, not by the name of the cohort. Changes
    of the code that computes it are not detected: empty the folder after such a change.

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
            As :func:`meshot.pipeline.segmentation.segment`, or if the network finds no white matter on a side.
        """
        return self._of(subject, side, subject.standard())

    def _of(self, subject: Subject, side: Hemisphere, scan: StandardScan) -> Mesh:
        paths = {s: self.path(subject, s, scan) for s in HEMISPHERES}
        if not paths[side].is_file():
            for name, found in initial_surfaces(scan, self.network).items():
                if not paths[name].is_file():  # another process may be reading it
                    write_mesh(paths[name], found.mesh)
        return read_mesh(paths[side])

    def path(self, subject: Subject, side: Hemisphere, scan: StandardScan) -> Path:
        """The path at which the initial surface of one side is stored."""
        return self.folder / _cohort(subject) / f"{subject.name}_{_scan_digest(scan)}_{side}.surf.gii"

    def example(self, subject: Subject, surfaces: Sequence[SurfaceKey], needs: Sequence[SurfaceKey]) -> Example:
        """The example of one subject, with the given true surfaces and the initial surfaces that are needed.

        Raises
        ------
        ValueError
            If an initial surface other than the white one is needed, or the cohort lacks a true surface.
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
        """The examples of all scans of a split, from one or more cohorts on disk.

        Parameters
        ----------
        cohorts : sequence of path
        split : str
            "train", "validation" or "test".
        surfaces, needs : sequence of keys
            Keys of the true and of the initial surfaces, usually those of a system.
        progress : callable
            Wraps the list of scans, for example tqdm.

        Raises
        ------
        ValueError
            If a folder is not a cohort, or no cohort has a scan in the split.
        """
        return [self.example(subject, surfaces, needs) for subject in progress(scans_of(cohorts, split))]


def _cohort(subject: Subject) -> str:
    """The name of the folder of the cohort, also if its path is ``.``."""
    return subject.cohort.absolute().name


def _scan_digest(scan: StandardScan) -> str:
    content = np.ascontiguousarray(scan.volume.data).tobytes() + scan.volume.affine.tobytes()
    return hashlib.sha256(content).hexdigest()[:12]
