"""The small files of a BIDS data set: its description, ``.bidsignore``, and the sidecars of scans."""

from pathlib import Path

from meshot.extras import needing
from meshot.study.json_file import json_of
from meshot.study.visits import DESCRIPTION, entities_of

with needing("bids"):
    import pathspec

IGNORE = ".bidsignore"


class Ignored:
    """Whether ``.bidsignore`` of a data set names a path, by the rules of gitignore.

    Parameters
    ----------
    dataset : pathlib.Path
        The top folder.
    """

    def __init__(self, dataset: Path):
        self.dataset = dataset
        file = dataset / IGNORE
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines() if file.is_file() else []
        self.patterns = pathspec.GitIgnoreSpec.from_lines(lines)

    def __call__(self, path: Path) -> bool:
        """Whether a path in the data set is ignored."""
        relative = path.relative_to(self.dataset).as_posix()
        return self.patterns.match_file(f"{relative}/" if path.is_dir() else relative)


def description_of(dataset: Path) -> dict:
    """What ``dataset_description.json`` of a data set holds.

    Parameters
    ----------
    dataset : pathlib.Path

    Raises
    ------
    ValueError
        If the folder or the file is missing, or the file is not a JSON object with Name and BIDSVersion.
    """
    if not dataset.is_dir():
        raise ValueError(f"{dataset} is no folder; name the top folder of a BIDS data set")
    file = dataset / DESCRIPTION
    if not file.is_file():
        raise ValueError(
            f"{dataset} has no {DESCRIPTION}, which every BIDS data set has; name its top folder, or complete the data "
            'set: a minimum is {"Name": "my study", "BIDSVersion": "1.10.0"}'
        )
    found = json_of(file)
    missing = [key for key in ("Name", "BIDSVersion") if key not in found]
    if missing:
        raise ValueError(f"{file} lacks {' and '.join(missing)}; add what is missing")
    return found


def sidecar_of(dataset: Path, scan: Path) -> dict:
    """The facts about a scan in its sidecars; those nearer to the scan count more (the inheritance principle).

    Parameters
    ----------
    dataset, scan : pathlib.Path

    Raises
    ------
    ValueError
        As :func:`meshot.study.json_file.json_of`.
    """
    entities, facts = entities_of(scan.name).items(), {}
    suffix = scan.name.split(".")[0].split("_")[-1]
    folders = [folder for folder in (scan.parent, *scan.parent.parents) if folder.is_relative_to(dataset)]
    for folder in reversed(folders):
        fitting = [
            file
            for file in folder.glob(f"*{suffix}.json")
            if file.name.split(".")[0].split("_")[-1] == suffix and entities_of(file.name).items() <= entities
        ]
        for file in sorted(fitting, key=lambda file: len(entities_of(file.name))):
            facts |= json_of(file)
    return facts
