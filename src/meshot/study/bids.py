"""What is reconstructed together: one participant in one session."""

import dataclasses
import functools
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path

from meshot.errors import require_choice
from meshot.extras import needing
from meshot.pipeline import QualityWarning

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
    warnings : tuple of QualityWarning
    trouble : str, optional
        Why there is nothing to reconstruct.
    """

    participant: str
    session: str | None = None
    scans: tuple[Path, ...] = ()
    entities: tuple[tuple[str, str], ...] = ()
    mask: Path | None = None
    notes: tuple[str, ...] = ()
    warnings: tuple[QualityWarning, ...] = ()
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
    """The entities in the name of a file, such as ``{"sub": "01", "run": "1"}``; without those that are none."""
    found = [_ENTITY.fullmatch(part) for part in name.split(".")[0].split("_")]
    return {match[1]: match[2] for match in found if match}


def bare_label(label: str, kind: str) -> str:
    """A label as it stands in names: ``01`` for ``01`` and for ``sub-01``."""
    bare = label.removeprefix(f"{kind}-")
    if not re.fullmatch(r"[0-9a-zA-Z+]+", bare):
        raise ValueError(f"{label!r} is no label; letters and digits are needed, such as 01 or {kind}-01")
    return bare


def visits_of_files(paths: Sequence[Path]) -> list[Visit]:
    """A visit for each file; participant and session are taken from names as BIDS has them, or are the whole name.

    Raises
    ------
    ValueError
        If two files would have the same label, or a name holds no letter and no digit.
    """
    found: dict[str, Visit] = {}
    for path in paths:
        entities = entities_of(path.name)
        ending = next((e for e in sorted(ENDINGS, key=len, reverse=True) if path.name.lower().endswith(e)), "")
        stem = path.name[: len(path.name) - len(ending)].removesuffix("_T1w")
        participant = entities.get("sub") or re.sub(r"[^0-9a-zA-Z]", "", stem)
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


# Files that hold a JSON object.


def json_of(file: Path) -> dict:
    """The JSON object in a file."""
    try:
        found = json.loads(file.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file} is not JSON in UTF-8 ({error}); mend it") from error
    if not isinstance(found, dict):
        raise ValueError(f"{file} holds a {type(found).__name__}; a JSON object, {{...}}, is needed: mend it")
    return found


# The small files of a BIDS data set: its description, ``.bidsignore``, and the sidecars of scans.

IGNORE = ".bidsignore"


class Ignored:
    """Whether ``.bidsignore`` of a data set names a path, by the rules of gitignore."""

    # ``dataset``: the top folder.

    def __init__(self, dataset: Path):
        with needing("bids"):  # here, since scans that are no data set need it not
            import pathspec

        self.dataset = dataset
        file = dataset / IGNORE
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines() if file.is_file() else []
        self.patterns = pathspec.GitIgnoreSpec.from_lines(lines)

    def __call__(self, path: Path) -> bool:
        """Whether a path in the data set is ignored."""
        relative = path.relative_to(self.dataset).as_posix()
        return self.patterns.match_file(f"{relative}/" if path.is_dir() else relative)


def description_of(dataset: Path) -> dict:
    """What ``dataset_description.json`` of a data set holds."""
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
    """The facts about a scan in its sidecars; those nearer to the scan count more (the inheritance principle)."""
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


# The T1-weighted scans of a BIDS data set, by the names that the BIDS specification allows.

#: The entities that are one protocol: only scans with the same ones are averaged.
PROTOCOL = ("acq", "ce", "rec", "echo", "part", "chunk", "task")
#: Long names of the specification -> entities in names.
_SHORT = {
    "acquisition": "acq",
    "ceagent": "ce",
    "reconstruction": "rec",
    "run": "run",
    "echo": "echo",
    "part": "part",
    "chunk": "chunk",
    "task": "task",
}
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
    entities : tuple of pairs
        Key and value of any entity that the name must have, such as ``("rec", "norm")``; with an empty value, those
        that it must not have.
    """

    participants: tuple[str, ...] = ()
    sessions: tuple[str, ...] = ()
    acquisition: str | None = None
    run: str | None = None
    several: str = "average"
    derivatives: Path | None = None
    entities: tuple[tuple[str, str], ...] = ()


def visits_of_bids(dataset: Path, choice: Choice | None = None) -> list[Visit]:
    """The visits of a BIDS data set, named by its top folder, in the order of their labels; troubled ones say why.

    Raises
    ------
    ValueError
        If the folder is no BIDS data set, its description cannot be read, or a label that was asked for is not there.
    """
    choice = choice or Choice()
    for key, _ in choice.entities:
        require_choice(key, "the entity of a filter", _ORDER[2:])
    description_of(dataset)
    if choice.derivatives is not None:
        description_of(choice.derivatives)
    ignored = Ignored(dataset)
    folders = {path.name[4:]: path for path in sorted(dataset.glob("sub-*")) if path.is_dir() and not ignored(path)}
    if not folders:
        raise ValueError(f"{dataset} has no folder sub-...; name the top folder of a BIDS data set")
    wanted = _wanted(choice.participants, list(folders), "sub")
    found = []
    for label in wanted:
        try:
            found += _visits_of_participant(dataset, folders[label], choice, ignored)
        except PermissionError as error:
            why = f"{error.filename} cannot be read ({error.strerror}); give yourself the permission"
            found.append(Visit(label, trouble=why))
    if choice.sessions:
        sessions = sorted({visit.session for visit in found if visit.session}, key=in_order)
        known = _wanted(choice.sessions, sessions, "ses")
        found = [visit for visit in found if visit.session in known]
    return found


def missing_participants(dataset: Path) -> list[str]:
    """The participants in ``participants.tsv`` that have no folder."""
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
    return sorted(set(labels) if labels else known, key=in_order)


def _require_readable(folder: Path) -> None:
    """Raise PermissionError if a folder may not be listed, which glob would take for an empty one."""
    if folder.is_dir():
        with os.scandir(folder):
            pass


def _visits_of_participant(dataset: Path, folder: Path, choice: Choice, ignored: Ignored) -> list[Visit]:
    _require_readable(folder)
    sessions = sorted(folder.glob("ses-*"), key=lambda path: in_order(path.name))
    sessions = [path for path in sessions if path.is_dir() and not ignored(path)]
    places = [(None, folder), *((path.name[4:], path) for path in sessions)]
    found = []
    for session, place in places:
        _require_readable(place / "anat")
        names = []  # the scans whose whole path the specification allows, with their entities
        for path in sorted((place / "anat").glob("*_T1w.nii*"), key=lambda path: in_order(path.name)):
            relative = path.relative_to(dataset).as_posix()
            match = next((m for rule in _rules() if (m := rule.match(relative))), None)
            if match and match["suffix"] == "T1w" and not ignored(path):
                entities = {_SHORT[key]: value for key, value in match.groupdict().items() if key in _SHORT and value}
                if entities.get("part", "mag") == "mag":
                    names.append((path, entities))
        if names:
            found.append(_visit(dataset, Visit(folder.name[4:], session), names, choice))
    if found:
        return found
    there = sorted(p for p in folder.rglob("anat/*") if p.name.endswith((".nii", ".nii.gz")) and not ignored(p))
    broken = [f"{path.name}: {_broken_rule(path.relative_to(dataset))}" for path in there[:4]]
    why = f"; anat holds {'; '.join(broken)}" if broken else f": a name such as {folder.name}_T1w.nii.gz is needed"
    return [Visit(folder.name[4:], trouble=f"{folder.name} has no T1-weighted scan{why}")]


#: The entities of anatomical scans, in the order that names must have.
_ORDER = ("sub", "ses", "task", "acq", "ce", "rec", "run", "echo", "part", "chunk")
_LABEL = "[0-9a-zA-Z+]+"


def _broken_rule(path: Path) -> str:
    """Which rule of BIDS the path of a scan, relative to its data set, breaks."""
    *folders, name = path.parts
    *entities, suffix = name.split(".")[0].split("_")
    for folder in folders[:-1]:
        if not re.fullmatch(f"(sub|ses)-{_LABEL}", folder):
            return f"the label of the folder {folder} may have letters and digits only"
        if folder not in entities:
            return f"its name lacks {folder}, the name of its folder"
    keys = [entity.partition("-")[0] for entity in entities]
    for key, entity in zip(keys, entities, strict=True):
        if not re.fullmatch(f"[a-z]+-{_LABEL}", entity):
            return f"{entity!r} is no entity; a key, a hyphen, and letters and digits are needed, such as acq-mprage"
        if key in ("sub", "ses") and entity not in folders:
            return f"it lies in no folder {entity}"
        if key in ("run", "echo", "chunk") and not entity.partition("-")[2].isdigit():
            return f"{entity} has no number"
        if key not in _ORDER:
            return f"a raw T1-weighted scan has no entity {key}"
        if keys.count(key) > 1:
            return f"it has the entity {key} twice"
    if suffix != "T1w":
        return f"its suffix is {suffix}; T1w is needed"
    right = sorted(entities, key=lambda entity: _ORDER.index(entity.partition("-")[0]))
    if right != entities:
        return f"its entities stand in another order; {'_'.join([*right, name.split('_')[-1]])} is needed"
    if "part-phase" in entities:
        return "it holds the phase; the magnitude is needed"
    return "the specification has no such name"


def in_order(name: str) -> list[tuple[bool, int, str]]:
    """The key by which names are sorted: digits count as numbers, so that run-2 comes before run-10."""
    parts = [part for part in re.split(r"(\d+)", name) if part]
    return [(not part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]


@functools.cache
def _rules() -> list[re.Pattern]:
    """Regular expressions of the anatomical scans, from the machine-readable BIDS specification."""
    with needing("bids"):
        import bidsschematools.rules
        import bidsschematools.schema

    schema = bidsschematools.schema.load_schema()
    rules = bidsschematools.rules.regexify_filename_rules(schema.rules.files.raw.anat, schema, level=1)
    return [re.compile(rule["regex"]) for rule in rules]


def _visit(dataset: Path, visit: Visit, names: list[tuple[Path, dict[str, str]]], choice: Choice) -> Visit:
    def bare(label: str | None) -> str | int | None:  # indices may have leading zeros
        return int(label) if label is not None and label.isdigit() else label

    for key, value in (("acq", choice.acquisition), ("run", choice.run), *choice.entities):
        if value is not None:
            names = [(path, found) for path, found in names if bare(found.get(key)) == bare(value or None)]
            if not names:
                what = f"with {key}-{value}" if value else f"without {key}"
                return dataclasses.replace(visit, trouble=f"{visit.label} has no T1-weighted scan {what}")
    protocols = {tuple((k, f[k]) for k in PROTOCOL if k in f): path.name for path, f in names}
    if len(protocols) > 1:
        values = {key: {dict(protocol).get(key, "") for protocol in protocols} for key in PROTOCOL}
        key = next(key for key in PROTOCOL if len(values[key]) > 1)
        remedies = [f"--filter {key}-{value}" for value in sorted(values[key])]
        trouble = (
            f"{visit.label} has T1-weighted scans of several protocols: {', '.join(protocols.values())}; choose one "
            f"with {' or '.join(remedies)}, or name the others in .bidsignore"
        )
        return dataclasses.replace(visit, trouble=trouble)
    runs: dict[object, str] = {}
    for path, found in names:
        run = int(found["run"]) if "run" in found else None
        if run in runs:
            trouble = f"{runs[run]} and {path.name} are the same run twice; remove one, or name it in .bidsignore"
            return dataclasses.replace(visit, trouble=trouble)
        runs[run] = path.name
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


def _sidecar_warnings(dataset: Path, path: Path) -> list[QualityWarning]:
    try:
        echo = sidecar_of(dataset, path).get("EchoTime")
    except ValueError as error:
        return [QualityWarning("unreadable_sidecar", f"{error}; the sidecar is not used")]
    if isinstance(echo, int | float) and echo > LONGEST_ECHO:
        text = (
            f"{path.name} was taken with an echo time of {1000 * echo:g} ms; a T1 has less than "
            f"{1000 * LONGEST_ECHO:g} ms: is it a T2?"
        )
        return [QualityWarning("long_echo_time", text, 1000 * echo)]
    return []


# Brain masks from a data set of derivatives.

#: Spaces that are the grid of the scan.
_OWN_SPACES = (None, "T1w", "orig")
_FREE = ("space", "desc", "sub", "ses")


def brain_mask_of(derivatives: Path, visit: Visit) -> Path:
    """The brain mask of a visit: a name such as ``sub-01_ses-02_desc-brain_mask.nii.gz``, on the grid of the scan."""
    # The mask may leave out entities of the scan, but may not contradict them. The one with the most entities counts.
    scan = entities_of(visit.scans[0].name)
    folders = [derivatives.joinpath(*visit.parts, "anat"), derivatives / visit.parts[0] / "anat"]
    fitting = [
        path
        for folder in dict.fromkeys(folders)
        for path in sorted(folder.glob("*_mask.nii*"))
        if _fits(entities_of(path.name), scan)
    ]
    if not fitting:
        raise ValueError(
            f"{derivatives} has no brain mask for {visit.label}; {visit.label}_desc-brain_mask.nii.gz in "
            f"{folders[0].relative_to(derivatives)} is needed, on the grid of {visit.scans[0].name}"
        )
    most = max(_n_entities(path) for path in fitting)
    best = [path for path in fitting if _n_entities(path) == most]
    if len(best) > 1:
        raise ValueError(f"{best[0].name} and {best[1].name} fit {visit.label} equally well; remove one of the masks")
    return best[0]


def _fits(mask: dict[str, str], scan: dict[str, str]) -> bool:
    own = mask.get("desc") == "brain" and mask.get("space") in _OWN_SPACES and mask.get("sub") == scan.get("sub")
    return (
        own
        and all(scan.get(key) == value for key, value in mask.items() if key not in _FREE)
        and (mask.get("ses") in (None, scan.get("ses")))
    )


def _n_entities(path: Path) -> int:
    return len([key for key in entities_of(path.name) if key not in ("space", "desc")])
