"""Training of a system from its name and a configuration, with output files."""

import dataclasses
import hashlib
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh, read_mesh, write_mesh
from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.pipeline.reconstruction import SEGMENTATION, require_placement
from meshot.pipeline.segmentation import initial_surfaces
from meshot.pipeline.training_files import (
    STATE_FOLDER,
    placement_of,
    run_watched_training,
    scans_of,
    shown_command,
    whole_record,
    write_record,
)
from meshot.provenance import provenance
from meshot.synth import Subject
from meshot.systems import SHIPPED, Example, ExampleSets, Scan, SurfaceKey, SurfaceSystem, get_system, read_settings
from meshot.types import PLACEMENTS
from meshot.volume import StandardScan


def run_system_training(
    name: str,
    config: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    segmentation: str | os.PathLike,
    initial: str | os.PathLike,
    changes: Sequence[str] = (),
    device: torch.device | None = None,
) -> SurfaceSystem:
    """Train a system on cohorts, show a progress bar, and write the output files.

    For every part of the system, ``folder`` receives the weights ``PART.safetensors``, the record ``PART.json``, the
    log ``PART.log.jsonl`` and its picture ``PART.png``. A stopped training resumes from ``state/``.

    Parameters
    ----------
    name : str
        The name of the system: see :func:`meshot.systems.get_system`.
    config : path or str
        A YAML file, or the name of a configuration of the system.
    cohorts : sequence of path
    folder : path
    segmentation : path
        Weights of the segmentation network, which makes the initial surfaces.
    initial : path
        The folder of initial surfaces. Those that exist already are not computed again.
    changes : sequence of str
        Settings that replace those of the configuration, such as ``training.seed=1``.
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.

    Raises
    ------
    ValueError
        If the system is unknown, or the configuration, a cohort, the weights or the folder is invalid.
    """
    folder, made, kind = Path(folder), provenance(), get_system(name)
    settings = read_settings(kind, config, changes)
    untrained = kind.prepare(settings)
    network, _ = read_weights(segmentation, SegmentationNetwork)
    placement = placement_of(cohorts)
    require_placement(network, placement, " and ".join(map(str, cohorts)))
    surfaces = InitialSurfaces(initial, network)
    sets = (
        surfaces.examples(
            cohorts, split, kind.surfaces_of(settings), kind.needs, lambda found, s=split: tqdm(found, desc=s)
        )
        for split in ("train", "validation")
    )
    examples = ExampleSets(*sets)
    found = run_watched_training(
        folder, made, lambda report: kind.train(examples, settings, folder / STATE_FOLDER, report, device, untrained)
    )
    own = None if Path(segmentation) == SHIPPED / SEGMENTATION else segmentation
    command = shown_command(f"train {name}", config, cohorts, folder, changes, segmentation=own, device=device)
    extra = {"segmentation_sha256": network_digest(network)} if kind.needs else {}
    extra |= {} if placement == PLACEMENTS[0] else {"placement": placement}
    parts = {}
    for part, each in found.parts.items():
        settings = {key: value for key, value in each.record.items() if key != "results"}
        record = whole_record(folder, settings, each.record["results"] | extra, command, cohorts)
        parts[part] = dataclasses.replace(each, record=record)
    trained = kind(parts)
    trained.save(folder)
    for part, each in trained.parts.items():
        write_record(folder, part, each.record, each.log)
    return trained


# Training examples from cohorts: scans, true surfaces, and initial surfaces, which are stored on disk.


class InitialSurfaces:
    """Initial surfaces of subjects, stored in a folder and computed on first use.

    A stored surface is identified by the weights of the network and by the scan, not by the name of the cohort. Changes
    of the code that computes it are not detected: empty the folder after such a change.
    """

    def __init__(self, folder: str | os.PathLike, network: SegmentationNetwork):
        self.folder = Path(folder) / f"segmentation-{network_digest(network)[:12]}"
        self.network = network

    def of(self, subject: Subject, side: Hemisphere, scan: StandardScan | None = None) -> Mesh:
        """The initial white surface of one side, in the standard space, in mm. The scan is that of the subject.

        Raises
        ------
        ValueError
            As :func:`meshot.pipeline.segment`, or if the network finds no white matter on a side.
        """
        scan = subject.standard() if scan is None else scan
        paths = {s: self.path(subject, s, scan) for s in HEMISPHERES}
        if not paths[side].is_file():
            for name, found in initial_surfaces(scan, self.network).items():
                if not paths[name].is_file():  # another process may be reading it
                    write_mesh(paths[name], found.mesh)
        return read_mesh(paths[side])

    def path(self, subject: Subject, side: Hemisphere, scan: StandardScan) -> Path:
        """The path at which the initial surface of one side is stored."""
        content = np.ascontiguousarray(scan.volume.data).tobytes() + scan.volume.affine.tobytes()
        digest = hashlib.sha256(content).hexdigest()[:12]
        return self.folder / _cohort(subject) / f"{subject.name}_{digest}_{side}.surf.gii"

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
        initial = {key: self.of(subject, key[0], standard) for key in needs}
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
