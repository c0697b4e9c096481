"""What is reconstructed together: one participant in one session."""

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path

#: The file by which a BIDS data set is known.
DESCRIPTION = "dataset_description.json"
ENDINGS = (".nii", ".nii.gz", ".mgz", ".mgh")
_ENTITY = re.compile(r"([a-z]+)-([0-9a-zA-Z+]+)")


@dataclasses.dataclass(frozen=True)
class Visit:
    """The scans of one participant in one session, which give one pair of surfaces.

    Parameters
    ----------
    participant : str
        Without ``sub-``.
    session : str, optional
        Without ``ses-``. None if there are no sessions.
    scans : tuple of pathlib.Path
        One scan, or several that are averaged.
    entities : tuple of pairs
        What all scans have in common, such as ``("acq", "mprage")``, without participant and session.
    mask : pathlib.Path, optional
        The brain mask, on the grid of the first scan.
    notes : tuple of str
        What was chosen.
    warnings : tuple of str
    trouble : str, optional
        Why there is nothing to reconstruct.
    """

    participant: str
    session: str | None = None
    scans: tuple[Path, ...] = ()
    entities: tuple[tuple[str, str], ...] = ()
    mask: Path | None = None
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    trouble: str | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        """Participant and session as BIDS writes them, such as ``("sub-01", "ses-02")``."""
        return (f"sub-{self.participant}", *([f"ses-{self.session}"] if self.session else []))

    @property
    def label(self) -> str:
        """Participant and session in one word, such as ``sub-01_ses-02``."""
        return "_".join(self.parts)

    @property
    def prefix(self) -> str:
        """The start of the names of its files in BIDS, such as ``sub-01_ses-02_acq-mprage``."""
        return "_".join([*self.parts, *(f"{key}-{value}" for key, value in self.entities)])


def entities_of(name: str) -> dict[str, str]:
    """The entities in the name of a file, such as ``{"sub": "01", "run": "1"}``; without those that are none.

    Parameters
    ----------
    name : str
        Such as ``sub-01_run-1_T1w.nii.gz``.
    """
    found = [_ENTITY.fullmatch(part) for part in name.split(".")[0].split("_")]
    return {match[1]: match[2] for match in found if match}


def bare_label(label: str, kind: str) -> str:
    """A label as it stands in names: ``01`` for ``01`` and for ``sub-01``.

    Parameters
    ----------
    label : str
    kind : str
        "sub" or "ses".

    Raises
    ------
    ValueError
        If it has other characters than letters, digits and +.
    """
    bare = label.removeprefix(f"{kind}-")
    if not re.fullmatch(r"[0-9a-zA-Z+]+", bare):
        raise ValueError(f"{label!r} is no label; letters and digits are needed, such as 01 or {kind}-01")
    return bare


def visits_of_files(paths: Sequence[Path]) -> list[Visit]:
    """A visit for each file; participant and session are taken from names as BIDS has them, or are the whole name.

    Parameters
    ----------
    paths : sequence of pathlib.Path

    Raises
    ------
    ValueError
        If two files would have the same label, or a name holds no letter and no digit.
    """
    found: dict[str, Visit] = {}
    for path in paths:
        entities = entities_of(path.name)
        participant = entities.get("sub") or re.sub(r"[^0-9a-zA-Z]", "", _stem(path.name))
        if not participant:
            raise ValueError(f"{path} has no letter and no digit in its name, and gives no label; rename it")
        visit = Visit(participant, entities.get("ses"), (path,))
        if visit.label in found:
            other = found[visit.label].scans[0]
            raise ValueError(f"{other} and {path} would both be {visit.label}; rename one, or reconstruct them apart")
        found[visit.label] = visit
    return list(found.values())


def visits_of_folder(folder: Path) -> list[Visit]:
    """A visit for each scan in a folder that is not BIDS.

    Parameters
    ----------
    folder : pathlib.Path

    Raises
    ------
    ValueError
        If there is no scan; otherwise as :func:`meshot.study.visits_of_files`.
    """
    paths = sorted(path for path in folder.iterdir() if path.name.lower().endswith(ENDINGS) and path.is_file())
    if not paths:
        raise ValueError(
            f"{folder} holds no scan ({', '.join(ENDINGS)}) and no dataset_description.json; name the top folder of a "
            "BIDS data set, or a folder of scans"
        )
    return visits_of_files(paths)


def _stem(name: str) -> str:
    ending = next((e for e in sorted(ENDINGS, key=len, reverse=True) if name.lower().endswith(e)), "")
    return name[: len(name) - len(ending)].removesuffix("_T1w")
