"""Small BIDS data sets, and a visit whose arrival ends the process that reads it."""

import json
import os
from pathlib import Path

import nibabel
import numpy as np

from meshot.study import StudySettings
from meshot.study.bids import Visit

#: A sagittal scan of 4 mm voxels, turned: its axes point to the back, to the top, and to the right.
TURNED = np.array([[0, 0, 4.0, -96], [-4.2, 0, 0, 76], [0, 4.1, 0, -72], [0, 0, 0, 1]])
SHAPE = (40, 40, 48)


def add_scan(dataset: Path, name: str, source: Path, facts: dict | None = None) -> Path:
    """A scan and its sidecar under a name such as ``sub-01_ses-02_T1w.nii.gz``."""
    parts = [part for part in name.split("_") if part.startswith(("sub-", "ses-"))]
    path = dataset.joinpath(*parts, "anat", name)
    path.parent.mkdir(parents=True, exist_ok=True)
    image = nibabel.load(source)
    nibabel.save(image, path)
    if facts is not None:
        path.with_name(f"{name.split('.')[0]}.json").write_text(json.dumps(facts))
    return path


def new_dataset(folder: Path) -> Path:
    """A folder with the description that every data set has."""
    folder.mkdir()
    (folder / "dataset_description.json").write_text('{"Name": "two balls", "BIDSVersion": "1.10.0"}')
    return folder


def network_words(settings: StudySettings) -> list[str]:
    """The options of the command line that name the networks of these settings."""
    return ["--system", "ddot", "--weights", str(settings.weights), "--segmentation", str(settings.segmentation)]


class DeadlyVisit(Visit):
    """As if the process ran out of memory."""

    def __reduce__(self):
        """What the other process does when it reads this."""
        return os._exit, (9,)
