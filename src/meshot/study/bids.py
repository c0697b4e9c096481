"""The T1-weighted scans of a BIDS data set, by the names that the BIDS specification allows."""

import dataclasses
import functools
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path

from meshot.extras import needing
from meshot.study.bids_files import Ignored, description_of, sidecar_of
from meshot.study.brain_masks import brain_mask_of
from meshot.study.visits import Visit, bare_label

with needing("bids"):
    import bidsschematools.rules
    import bidsschematools.schema

#: The entities that are one protocol: only scans with the same ones are averaged.
PROTOCOL = ("acq", "ce", "rec", "echo", "part", "chunk", "task")
#: Long names of the specification -> entities in names.
_SHORT = {
    "acquisition": "acq", "ceagent": "ce", "reconstruction": "rec", "run": "run", "echo": "echo", "part": "part",
    "chunk": "chunk", "task": "task",
}  # fmt: skip
#: T1-weighted scans have echo times of a few milliseconds, T2-weighted scans of 60 ms and more; in seconds.
LONGEST_ECHO = 0.04


@dataclasses.dataclass(frozen=True)
class Choice:
    """Which scans of a data set are taken.

    Parameters
    ----------
    participants, sessions : tuple of str
        Labels; all if empty.
    acquisition, run : str, optional
        The value of the entity ``acq`` or ``run``.
    several : str
        "average" or "first": what becomes of several runs of one protocol.
    derivatives : pathlib.Path, optional
        A data set of derivatives with brain masks.
    """

    participants: tuple[str, ...] = ()
    sessions: tuple[str, ...] = ()
    acquisition: str | None = None
    run: str | None = None
    several: str = "average"
    derivatives: Path | None = None


def visits_of_bids(dataset: Path, choice: Choice | None = None) -> list[Visit]:
    """The visits of a BIDS data set, in the order of their labels; those with trouble say why.

    Parameters
    ----------
    dataset : pathlib.Path
        The top folder.
    choice : Choice, optional

    Raises
    ------
    ValueError
        If the folder is no BIDS data set, its description cannot be read, or a label that was asked for is not there.
    """
    choice = choice or Choice()
    description_of(dataset)
    if choice.derivatives is not None:
        description_of(choice.derivatives)
    ignored = Ignored(dataset)
    folders = {path.name[4:]: path for path in sorted(dataset.glob("sub-*")) if path.is_dir() and not ignored(path)}
    if not folders:
        raise ValueError(f"{dataset} has no folder sub-...; name the top folder of a BIDS data set")
    wanted = _wanted(choice.participants, list(folders), "sub")
    found = [visit for label in wanted for visit in _readable_visits(dataset, folders[label], choice, ignored)]
    if choice.sessions:
        sessions = sorted({visit.session for visit in found if visit.session})
        known = _wanted(choice.sessions, sessions, "ses")
        found = [visit for visit in found if visit.session in known]
    return found


def missing_participants(dataset: Path) -> list[str]:
    """The participants in ``participants.tsv`` that have no folder.

    Parameters
    ----------
    dataset : pathlib.Path
    """
    table = dataset / "participants.tsv"
    if not table.is_file():
        return []
    lines = table.read_text(encoding="utf-8", errors="replace").splitlines()[1:]
    names = [line.split("\t")[0].strip() for line in lines if line.strip()]
    return [name for name in names if name.startswith("sub-") and not (dataset / name).is_dir()]


def _wanted(asked: Sequence[str], known: list[str], kind: str) -> list[str]:
    labels = [bare_label(label, kind) for label in asked]
    unknown = [label for label in labels if label not in known]
    if unknown:
        some = ", ".join(known[:8]) + (", …" if len(known) > 8 else "")
        raise ValueError(f"there is no {kind}-{unknown[0]} in the data set; it has {some or 'none'}")
    return sorted(set(labels)) if labels else sorted(known)


def _readable_visits(dataset: Path, folder: Path, choice: Choice, ignored: Ignored) -> list[Visit]:
    """The visits of a participant; one with trouble if a folder may not be read."""
    try:
        return _visits_of_participant(dataset, folder, choice, ignored)
    except PermissionError as error:
        why = f"{error.filename} cannot be read ({error.strerror}); give yourself the permission"
        return [Visit(folder.name[4:], trouble=why)]


def _require_readable(folder: Path) -> None:
    """Raise PermissionError if a folder may not be listed, which glob would take for an empty one."""
    if folder.is_dir():
        with os.scandir(folder):
            pass


def _visits_of_participant(dataset: Path, folder: Path, choice: Choice, ignored: Ignored) -> list[Visit]:
    _require_readable(folder)
    sessions = [path for path in sorted(folder.glob("ses-*")) if path.is_dir() and not ignored(path)]
    places = [(None, folder), *((path.name[4:], path) for path in sessions)]
    found = []
    for session, place in places:
        _require_readable(place / "anat")
        names = _named_t1(dataset, place, ignored)
        if names:
            found.append(_visit(dataset, Visit(folder.name[4:], session), names, choice))
    if found:
        return found
    there = sorted(p.name for p in folder.rglob("anat/*") if p.name.endswith((".nii", ".nii.gz")) and not ignored(p))
    why = f"; anat holds {', '.join(there[:4])}" if there else ""
    return [Visit(folder.name[4:], trouble=f"{folder.name} has no T1-weighted scan: a name such as "
                  f"{folder.name}_T1w.nii.gz is needed{why}")]  # fmt: skip


def _named_t1(dataset: Path, place: Path, ignored: Ignored) -> list[tuple[Path, dict[str, str]]]:
    """The scans whose whole path the specification allows, with their entities."""
    found = []
    for path in sorted((place / "anat").glob("*_T1w.nii*")):
        relative = path.relative_to(dataset).as_posix()
        match = next((m for rule in _rules() if (m := rule.match(relative))), None)
        if match and match["suffix"] == "T1w" and not ignored(path):
            entities = {_SHORT[key]: value for key, value in match.groupdict().items() if key in _SHORT and value}
            if entities.get("part", "mag") == "mag":
                found.append((path, entities))
    return found


@functools.cache
def _rules() -> list[re.Pattern]:
    """Regular expressions of the anatomical scans, from the machine-readable BIDS specification."""
    schema = bidsschematools.schema.load_schema()
    rules = bidsschematools.rules.regexify_filename_rules(schema.rules.files.raw.anat, schema, level=1)
    return [re.compile(rule["regex"]) for rule in rules]


def _visit(dataset: Path, visit: Visit, names: list[tuple[Path, dict[str, str]]], choice: Choice) -> Visit:
    for key, value in (("acq", choice.acquisition), ("run", choice.run)):
        if value is not None:
            names = [(path, found) for path, found in names if _same(found.get(key), value)]
            if not names:
                return dataclasses.replace(visit, trouble=f"{visit.label} has no T1-weighted scan with {key}-{value}")
    trouble = _ambiguity(visit, names)
    if trouble:
        return dataclasses.replace(visit, trouble=trouble)
    notes = ()
    if len(names) > 1 and choice.several == "first":
        notes = (f"of {len(names)} runs only the first is used: {names[0][0].name}",)
        names = names[:1]
    elif len(names) > 1:
        notes = (f"{len(names)} runs are averaged: {', '.join(path.name for path, _ in names)}",)
    first = names[0][1]
    common = tuple((k, v) for k, v in first.items() if all(found.get(k) == v for _, found in names))
    warnings = tuple(w for path, _ in names for w in _sidecar_warnings(dataset, path))
    made = dataclasses.replace(
        visit, scans=tuple(path for path, _ in names), entities=common, notes=notes, warnings=warnings
    )
    if choice.derivatives is None:
        return made
    try:
        return dataclasses.replace(made, mask=brain_mask_of(choice.derivatives, made))
    except ValueError as error:
        return dataclasses.replace(made, trouble=str(error))


def _same(found: str | None, wanted: str) -> bool:
    """Whether two values of an entity agree; indices may have leading zeros."""
    if found is not None and found.isdigit() and wanted.isdigit():
        return int(found) == int(wanted)
    return found == wanted


def _ambiguity(visit: Visit, names: list[tuple[Path, dict[str, str]]]) -> str | None:
    protocols = {tuple((k, f[k]) for k in PROTOCOL if k in f): path.name for path, f in names}
    if len(protocols) > 1:
        return (
            f"{visit.label} has T1-weighted scans of several protocols: {', '.join(protocols.values())}; choose one "
            "with --acquisition, or name the others in .bidsignore"
        )
    runs: dict[object, str] = {}
    for path, found in names:
        run = int(found["run"]) if "run" in found else None
        if run in runs:
            return f"{runs[run]} and {path.name} are the same run twice; remove one, or name it in .bidsignore"
        runs[run] = path.name
    return None


def _sidecar_warnings(dataset: Path, path: Path) -> list[str]:
    try:
        echo = sidecar_of(dataset, path).get("EchoTime")
    except (ValueError, json.JSONDecodeError) as error:
        return [f"{error}; the sidecar is not used"]
    if isinstance(echo, int | float) and echo > LONGEST_ECHO:
        return [
            f"{path.name} was taken with an echo time of {1000 * echo:g} ms; a T1 has less than "
            f"{1000 * LONGEST_ECHO:g} ms: is it a T2?"
        ]
    return []
