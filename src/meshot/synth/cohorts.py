"""Cohorts of synthetic subjects on disk: recipes, generation, manifests, reading.

A recipe and a seed determine every subject. Generation can be resumed. A manifest shows which files have changed.
"""

import csv
import dataclasses
import json
import os
from pathlib import Path
from typing import Literal

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh, read_mesh
from meshot.types import Array, Float
from meshot.volume import StandardScan, Volume, read_volume, transform_points

Surface = Literal["white", "pial"]
Space = Literal["scanner", "standard"]
SPLITS = ("train", "validation", "test")
KINDS = ("template", "procedural")
#: Values in the ``dseg`` of a scan; 0 is air. In the standard space only 1 and 2 are used.
LABELS = {"left white": 1, "right white": 2, "left grey": 3, "right grey": 4, "deep grey": 5}
LABELS |= {"hindbrain": 6, "fluid": 7, "skull": 8, "scalp": 9}
#: The endings of the names of a scan's files.
T1, FACTS, TISSUE, SURFACE = "T1w.nii.gz", "T1w.json", "dseg.nii.gz", "hemi-{}_{}.surf.gii"
STANDARD_T1, STANDARD_LABELS = "space-MNI152_desc-standard_T1w.nii.gz", "space-MNI152_desc-standard_dseg.nii.gz"
TRANSFORM = "from-T1w_to-MNI152_mode-image_xfm.json"
_STANDARD = Path("derivatives") / "standard"


@dataclasses.dataclass(frozen=True)
class Participant:
    """One row of ``participants.tsv``."""

    participant_id: str  # such as sub-001
    split: str  # one of SPLITS
    kind: str  # "template" (made from fsaverage5) or "procedural" (made without it)
    seed: int  # of the anatomy


@dataclasses.dataclass(frozen=True, eq=False)
class Subject:
    """One scan of a participant, with its ground truth. All methods read from disk.

    Parameters
    ----------
    cohort : pathlib.Path
        The folder of the cohort.
    participant : Participant
    session, run : str, optional
        For example "01" and "1". None if the participant was scanned once.
    """

    cohort: Path
    participant: Participant
    session: str | None = None
    run: str | None = None

    @property
    def name(self) -> str:
        """The start of all its file names, such as ``sub-001`` or ``sub-001_ses-02_run-1``."""
        parts = (
            self.participant.participant_id,
            self.session and f"ses-{self.session}",
            self.run and f"run-{self.run}",
        )
        return "_".join(part for part in parts if part)

    def file(self, ending: str, standard: bool = False) -> Path:
        """The path of the file with this ending, such as ``T1w.nii.gz``."""
        session = [f"ses-{self.session}"] if self.session else []
        anat = Path(self.participant.participant_id, *session, "anat")
        return self.cohort / (_STANDARD if standard else "") / anat / f"{self.name}_{ending}"

    def files(self) -> list[Path]:
        """All its existing files, sorted by name."""
        found = [p for standard in (False, True) for p in self.file("", standard).parent.glob(f"{self.name}_*")]
        return sorted(found, key=lambda path: path.name)

    def scan(self) -> Volume:
        """The T1-weighted scan in arbitrary units, with its affine to scanner RAS."""
        return read_volume(self.file(T1))

    def tissue(self) -> Volume:
        """The most frequent tissue in each voxel of the scan, see ``LABELS``."""
        return _labels(self.file(TISSUE))

    def surface(self, kind: Surface, hemisphere: Hemisphere, space: Space = "scanner") -> Mesh:
        """A true surface, in scanner RAS or in the standard space (MNI152), in mm.

        Raises
        ------
        ValueError
            If kind, hemisphere or space is unknown, or the cohort does not have the surface.
        """
        if kind not in ("white", "pial") or hemisphere not in HEMISPHERES or space not in ("scanner", "standard"):
            raise ValueError(
                f"no surface {kind!r} {hemisphere!r} in space {space!r}; white or pial, left or right, scanner or "
                "standard"
            )
        path = self.file(SURFACE.format(hemisphere[0].upper(), kind))
        if not path.is_file():
            raise ValueError(
                f"{self.cohort} has no true {hemisphere} {kind} surface of {self.name} ({path.name} does not exist): "
                "make the cohort again, or ask for the surfaces that it has"
            )
        mesh = read_mesh(path)
        if space == "scanner":
            return mesh
        return mesh.with_vertices(transform_points(self.to_standard(), mesh.vertices))

    def to_standard(self) -> Float[Array, "4 4"]:
        """The affine from scanner RAS to MNI152 space, in mm."""
        return np.array(_json(self.file(TRANSFORM, standard=True))["matrix"], dtype=np.float64)

    def standard(self) -> StandardScan:
        """The scan on the standard grid, with values in [0, 1], and its transform to the scanner."""
        return StandardScan(read_volume(self.file(STANDARD_T1, standard=True)), self.to_standard())

    def standard_labels(self) -> Volume:
        """Standard grid: 1 inside the left white surface, 2 inside the right one, 0 elsewhere."""
        return _labels(self.file(STANDARD_LABELS, standard=True))

    def facts(self) -> dict:
        """How the scan was made: all drawn parameters, seeds, position (the sidecar file of the scan)."""
        return _json(self.file(FACTS))


def participants(
    cohort_dir: str | os.PathLike, split: str | None = None, unfinished: bool = False
) -> list[Participant]:
    """The participants of a cohort, sorted by name: those of one split of ``SPLITS``, by default of all.

    If ``unfinished``, participants are included that are planned but not yet made.

    Raises
    ------
    ValueError
        If there is no cohort, its table is damaged, or ``split`` is unknown.
    """
    if split is not None and split not in SPLITS:
        raise ValueError(f"split is {split!r}; one of {', '.join(SPLITS)} is needed, or None for all")
    cohort, path = Path(cohort_dir), Path(cohort_dir) / "participants.tsv"
    if not path.is_file():
        raise ValueError(f"{path} does not exist: {cohort} is no cohort; make one with meshot make-cohort")
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    try:
        found = [Participant(r["participant_id"], r["split"], r["kind"], int(r["seed"])) for r in rows]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no table of participants ({error!r}); make the cohort again") from error
    found = [p for p in found if split in (None, p.split)]
    return found if unfinished else [p for p in found if (cohort / p.participant_id).is_dir()]


def read_subject(
    cohort_dir: str | os.PathLike, participant_id: str, session: str | None = None, run: str | None = None
) -> Subject:
    """One scan of a participant; if several match, the first.

    Raises
    ------
    ValueError
        If there is none.
    """
    found = [
        scan
        for scan in scans(cohort_dir)
        if scan.participant.participant_id == participant_id
        and session in (None, scan.session)
        and run in (None, scan.run)
    ]
    if not found:
        wanted = "_".join(x for x in (participant_id, session and f"ses-{session}", run and f"run-{run}") if x)
        known = [p.participant_id for p in participants(cohort_dir)]
        raise ValueError(f"there is no finished scan {wanted} in {cohort_dir}; it has {', '.join(known) or 'none yet'}")
    return found[0]


def scans(cohort_dir: str | os.PathLike, split: str | None = None) -> list[Subject]:
    """All finished scans of a cohort: one per participant, or one per session and run."""
    cohort, found = Path(cohort_dir), []
    for participant in participants(cohort, split):
        for path in sorted((cohort / participant.participant_id).rglob("*_T1w.nii.gz")):
            parts = dict(part.split("-", 1) for part in path.name.split("_")[:-1])
            found.append(Subject(cohort, participant, parts.get("ses"), parts.get("run")))
    return found


def _labels(path: Path) -> Volume:
    volume = read_volume(path)
    return volume.with_data(volume.data.astype(np.uint8))


def _json(path: Path) -> dict:
    if not path.is_file():
        raise ValueError(f"{path} does not exist; make the cohort again")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path} is not whole JSON ({error}); make the cohort again") from error
