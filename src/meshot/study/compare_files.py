"""Which surfaces lie in a folder of reconstructions, by subject and side, whatever its layout."""

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

_SIDES = {"lh": "left", "rh": "right", "L": "left", "R": "right"}
_BIDS = re.compile(r"(?P<sub>sub-[^_]+)(?:_(?P<ses>ses-[^_]+))?_(?:.*_)?hemi-(?P<side>[LR])_(?:.*_)?(?P<name>[^_.]+)")
_FREESURFER = re.compile(r"(?P<side>[lr]h)\.(?P<name>[^.]+)")
#: The same surface in several formats counts once: the first of these is read.
_SUFFIXES = ("", ".surf.gii", ".ply", ".obj", ".off", ".stl", ".vtp")


class Place(NamedTuple):
    """A participant, a session (empty if there is one only) and a side."""

    participant: str
    session: str
    side: str

    def __str__(self) -> str:
        return " ".join(filter(None, self))


def find_surfaces(folder: str | os.PathLike, surface: str = "white") -> dict[Place, Path]:
    """The files of one kind of surface in a folder of subjects.

    Three layouts are known. FreeSurfer's: ``SUBJECT/surf/lh.white``. BIDS derivatives:
    ``sub-01_hemi-L_white.surf.gii`` at any depth. The folders of ``meshot reconstruct``: ``SUBJECT/lh.white``, or the
    same with the suffix of another format. A session is a folder ``ses-…``, or the end of a name ``sub-01_ses-02``.

    Parameters
    ----------
    folder : path
    surface : str
        Such as ``white`` or ``pial``.

    Returns
    -------
    dict
        In the order of participants, sessions and sides.

    Raises
    ------
    ValueError
        If the folder is missing or holds no such surface, or if one subject and side has two different files.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder; name a folder with a folder for each subject")
    found: dict[Place, list[Path]] = {}
    for path, stem in _files(folder):
        place = _place(path.relative_to(folder), stem, surface)
        if place is not None:
            found.setdefault(place, []).append(path)
    if not found:
        raise ValueError(
            f"{folder} holds no surface {surface}; needed are SUBJECT/surf/lh.{surface} (FreeSurfer), "
            f"sub-01_hemi-L_{surface}.surf.gii (BIDS) or SUBJECT/lh.{surface}"
        )
    return {place: _only(place, found[place]) for place in sorted(found)}


def _files(folder: Path) -> Iterator[tuple[Path, str]]:
    """Every file that may be a surface, without links to folders, and its name without the suffix of its format."""
    for parent, folders, names in os.walk(folder):
        folders.sort()
        for name in sorted(names):
            suffix = next((suffix for suffix in _SUFFIXES[1:] if name.endswith(suffix)), "")
            yield Path(parent, name), name.removesuffix(suffix)


def _place(path: Path, stem: str, surface: str) -> Place | None:
    if match := _BIDS.fullmatch(stem):
        return Place(match["sub"], match["ses"] or "", _SIDES[match["side"]]) if match["name"] == surface else None
    match = _FREESURFER.fullmatch(stem)
    if match is None or match["name"] != surface:
        return None
    parts = [part for part in path.parts[:-1] if part not in ("surf", "anat")]
    if not parts:
        return None
    participant, _, session = "_".join(parts).partition("_ses-")
    return Place(participant, session and f"ses-{session}", _SIDES[match["side"]])


def _only(place: Place, paths: list[Path]) -> Path:
    """The one file of a subject and side: formats of one surface, in one folder, are the same surface.

    Raises
    ------
    ValueError
        If there are two.
    """
    # BIDS: a description marks a variant, such as desc-initial, beside the result, which has none.
    paths = [path for path in paths if "_desc-" not in path.name] or paths
    by_suffix = {next(s for s in reversed(_SUFFIXES) if path.name.endswith(s)): path for path in paths}
    if len({path.parent for path in paths}) > 1 or len(by_suffix) < len(paths):
        names = " and ".join(str(path) for path in paths[:2])
        raise ValueError(f"{place} has two surfaces, {names}; move one of them to another folder")
    return by_suffix[min(by_suffix, key=_SUFFIXES.index)]


def paired_surfaces(
    found: Mapping[Place, Path], reference: Mapping[Place, Path], common: bool = False
) -> tuple[dict[Place, tuple[Path, Path]], list[str]]:
    """The pairs of two folders, and a sentence for each subject or side that is in one of them only.

    Parameters
    ----------
    found, reference : mapping
        As :func:`find_surfaces` returns them.
    common : bool
        Whether surfaces in one folder only are left out instead of refused.

    Raises
    ------
    ValueError
        If there are such surfaces and ``common`` is false, or if there is no pair.
    """
    lost = [
        f"{place} is only in the {name}"
        for one, other, name in ((found, reference, "reconstructed folder"), (reference, found, "reference"))
        for place in one
        if place not in other
    ]
    pairs = {place: (path, reference[place]) for place, path in found.items() if place in reference}
    if not pairs:
        raise ValueError(
            f"no subject and side is in both folders: the first has {next(iter(found))}, the reference has "
            f"{next(iter(reference))}; give the folders of the subjects the same names"
        )
    if lost and not common:
        more = f" and {len(lost) - 3} more" if len(lost) > 3 else ""
        raise ValueError(f"{'; '.join(lost[:3])}{more}; complete the folders, or compare the others with --common")
    return pairs, lost
