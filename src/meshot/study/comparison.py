"""A folder of surfaces compared with another: tables, data dictionaries and a page, in a folder of their own."""

import csv
import io
import json
import os
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from meshot.files import printable_name, whole_folder
from meshot.mesh import read_mesh
from meshot.metrics import Evaluation, evaluate, rigidly_aligned
from meshot.provenance import provenance
from meshot.statistics import mean_interval, paired_interval
from meshot.view import filled

# Which surfaces lie in a folder of reconstructions, by subject and side, whatever its layout.

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
        return " ".join(filter(None, self))  # of one scan, the side only


def find_surfaces(folder: str | os.PathLike, surface: str = "white") -> dict[Place, Path]:
    """The files of one kind of surface in a folder of subjects.

    Three layouts are known. FreeSurfer's: ``SUBJECT/surf/lh.white``. BIDS derivatives:
    ``sub-01_hemi-L_white.surf.gii`` at any depth. The folders of ``meshot reconstruct``: ``SUBJECT/lh.white``, or the
    same with the suffix of another format. A session is a folder ``ses-…``, or the end of a name ``sub-01_ses-02``.
    If there is no folder of a subject, files in the folder itself or in its ``surf`` are those of one scan, and its
    participant has an empty name. The result is in the order of participants, sessions and sides.

    Raises
    ------
    ValueError
        If the folder is missing or holds no such surface, or if one subject and side has two different files.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder; name a folder with a folder for each subject")
    found: dict[Place, list[Path]] = {}
    for parent, folders, names in os.walk(folder):  # without links to folders
        folders.sort()
        for name in sorted(names):
            suffix = next((suffix for suffix in _SUFFIXES[1:] if name.endswith(suffix)), "")
            place = _place(Path(parent, name).relative_to(folder), name.removesuffix(suffix), surface)
            if place is not None:
                found.setdefault(place, []).append(Path(parent, name))
    if not found:
        raise ValueError(
            f"{folder} holds no surface {surface}; needed are SUBJECT/surf/lh.{surface} (FreeSurfer), "
            f"sub-01_hemi-L_{surface}.surf.gii (BIDS) or SUBJECT/lh.{surface}, or lh.{surface} of one scan"
        )
    if any(place.participant for place in found):  # then files beside the folders of subjects are something else
        found = {place: paths for place, paths in found.items() if place.participant}
    return {place: _only(place, found[place]) for place in sorted(found)}


def _place(path: Path, stem: str, surface: str) -> Place | None:
    if match := _BIDS.fullmatch(stem):
        return Place(match["sub"], match["ses"] or "", _SIDES[match["side"]]) if match["name"] == surface else None
    match = _FREESURFER.fullmatch(stem)
    if match is None or match["name"] != surface:
        return None
    parts = [part for part in path.parts[:-1] if part not in ("surf", "anat")]
    participant, _, session = "_".join(parts).partition("_ses-")
    return Place(participant, session and f"ses-{session}", _SIDES[match["side"]])


def _only(place: Place, paths: list[Path]) -> Path:
    """The one file of a subject and side: formats of one surface, in one folder, are the same surface."""
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
    # The folder of one scan goes with that of another, or with the only subject of a folder of subjects.
    subjects = [{place[:2] for place in places} for places in (found, reference)]
    if all(len(each) == 1 for each in subjects) and ("", "") in subjects[0] | subjects[1]:
        named = max(subjects[0] | subjects[1])
        named = named if named[0] else (next(iter(found.values())).resolve().parent.name, "")
        found, reference = (
            {Place(*named, place.side): path for place, path in each.items()} for each in (found, reference)
        )
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


# All metrics of all pairs of two folders of surfaces, and their means with intervals over participants.

#: Sides of a summary: both means the average of the two sides of a participant.
SIDES = ("left", "right", "both")


class Compared(NamedTuple):
    """What a pair of surfaces scores, and the residue of its alignment (mm), None without one."""

    evaluation: Evaluation
    residue: float | None


def compared_pairs(
    pairs: Mapping[Place, tuple[Path, Path]],
    n_points: int = 100_000,
    seed: int = 0,
    n_emd_points: int = 5_000,
    progress: Callable[[Iterable], Iterable] = iter,
    align: bool = False,
) -> dict[Place, Compared]:
    """Evaluate every pair of surfaces, see :func:`meshot.evaluate`."""
    found = {}
    for place, paths in progress(pairs.items()):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                mesh, target = map(read_mesh, paths)
                aligned = rigidly_aligned(mesh, target, generator=seed) if align else None
                evaluation = evaluate(aligned.mesh if aligned else mesh, target, n_points, seed, n_emd_points)
                found[place] = Compared(evaluation, aligned.residue if aligned else None)
            except ValueError as error:
                raise ValueError(f"{place}: {error} (files {paths[0]} and {paths[1]})") from error
        for warning in said:
            warnings.warn(f"{place}: {warning.message}", warning.category, stacklevel=2)
    return found


def summary_rows(found: Mapping[Place, Compared]) -> list[dict]:
    """For each side and metric: the mean over participants, the mean floor, and their difference, with 95 % intervals.

    Sessions of a participant are averaged first, and for the side ``both`` also the two sides: a participant counts
    once. The difference is paired: value minus floor of the same participant. For distances it is what is more than
    sampling error; for area, volume and Euler number it is reconstructed minus reference. Intervals are Student's; with
    one participant they are None.
    """
    rows = []
    for side in SIDES:
        chosen = [place for place in found if side in (place.side, "both")]
        if not chosen or (side == "both" and len({place.side for place in chosen}) < 2):
            continue
        for name, metric in found[chosen[0]].evaluation.as_dict().items():
            values = _by_participant(found, chosen, name, "value")
            floors = _by_participant(found, chosen, name, "floor")
            row = {"side": side, "metric": name, "name": metric["name"], "unit": metric["unit"]}
            row |= {"participants": len(values)} | _entries("mean", values, None)
            rows.append(row | {"floor": float(np.mean(floors))} | _entries("difference", values, floors))
    return rows


def _by_participant(found: Mapping[Place, Compared], chosen: list[Place], name: str, key: str) -> list[float]:
    """The mean of a number over the sides of each session, and then over the sessions of each participant."""
    numbers: dict[str, dict[str, list[float]]] = {}
    for place in chosen:
        sessions = numbers.setdefault(place.participant, {})
        sessions.setdefault(place.session, []).append(getattr(getattr(found[place].evaluation, name), key))
    return [float(np.mean([np.mean(sides) for sides in sessions.values()])) for sessions in numbers.values()]


def _entries(name: str, values: list[float], floors: list[float] | None) -> dict[str, float | None]:
    if len(values) == 1:
        centre, low, high = values[0] - (floors[0] if floors else 0.0), None, None
    else:
        centre, low, high = mean_interval(values) if floors is None else paired_interval(values, floors)
    return {name: centre, f"{name}_low": low, f"{name}_high": high}


#: The files of a comparison.
SURFACES_TABLE, SUMMARY_TABLE, COMPARISON_PAGE = "surfaces.tsv", "summary.tsv", "table.html"
MISSING, ICP_RESIDUE = "n/a", "icp_residue"
_SUMMARY = {
    "side": "The side, or both: the average of the sides of a participant",
    "metric": "The metric, described in surfaces.json",
    "unit": "The unit of the metric",
    "participants": "Number of participants; sessions of one are averaged first",
    "mean": "Mean over participants",
    "mean_low": "Lower end of Student's 95 % interval of the mean",
    "mean_high": "Upper end of Student's 95 % interval of the mean",
    "floor": "Mean of the values of the reference against itself, or the mean of the reference's own values",
    "difference": "Mean over participants of value minus floor",
    "difference_low": "Lower end of the paired Student's 95 % interval of the difference",
    "difference_high": "Upper end of the paired Student's 95 % interval of the difference",
}


def write_comparison(
    reconstructed: str | os.PathLike,
    reference: str | os.PathLike,
    folder: str | os.PathLike,
    surface: str = "white",
    *,
    common: bool = False,
    align: bool = False,
    n_points: int = 100_000,
    n_emd_points: int = 5_000,
    seed: int = 0,
    progress: Callable[[Iterable], Iterable] = iter,
) -> list[dict]:
    """Compare a folder of surfaces with a reference, and write tables and a page; whole or not at all.

    ``surfaces.tsv`` has a row for each subject and side with all metrics of :func:`meshot.evaluate` and their floors;
    ``summary.tsv`` has the means over participants with 95 % intervals. A JSON file beside each describes its columns.
    ``table.html`` shows both.

    Parameters
    ----------
    reconstructed, reference : path
        Folders in any layout that :func:`meshot.study.find_surfaces` knows.
    folder : path
        New or empty.
    surface : str
        Such as ``white`` or ``pial``.
    common : bool
        Whether surfaces in one folder only are left out, with a warning, instead of refused.
    align : bool
        Whether each surface is first aligned with its reference, see :func:`meshot.metrics.rigidly_aligned`. Then
        ``surfaces.tsv`` has a column ``icp_residue``, in mm.
    n_points, n_emd_points, seed : int
        As in :func:`meshot.evaluate`.
    progress : callable
        Wraps the pairs, as ``tqdm`` does.

    Returns
    -------
    list of dict
        The rows of ``summary.tsv``.

    Raises
    ------
    ValueError
        If a subject or side is in one folder only, two surfaces are in different spaces, or a file cannot be read.

    Warns
    -----
    UserWarning
        For surfaces that are left out, and as :func:`meshot.evaluate`.
    """
    folders = {"reconstructed": printable_name(reconstructed), "reference": printable_name(reference)}
    pairs, lost = paired_surfaces(find_surfaces(reconstructed, surface), find_surfaces(reference, surface), common)
    for sentence in lost:
        warnings.warn(f"{sentence}: it is left out", stacklevel=2)
    settings = {"surface": surface, "align": align, "points": n_points, "emd_points": n_emd_points, "seed": seed}
    with whole_folder(folder) as temporary:
        found = compared_pairs(pairs, n_points, seed, n_emd_points, progress, align)
        summary = summary_rows(found)
        metrics = next(iter(found.values())).evaluation.as_dict()
        rows = []
        for place, compared in found.items():
            row = {"participant_id": place.participant, "session_id": place.session, "side": place.side}
            row |= dict(zip(("reconstructed", "reference"), map(printable_name, pairs[place]), strict=True))
            if compared.residue is not None:
                row |= {ICP_RESIDUE: compared.residue}
            for name, metric in compared.evaluation.as_dict().items():
                row |= {name: metric["value"], f"{name}_floor": metric["floor"]}
            rows.append(row)
        about = _dictionary(metrics, align) | {"meshot": folders | settings | provenance()}
        _write_table(temporary / SURFACES_TABLE, rows, about)
        described = {name: {"Description": text} for name, text in _SUMMARY.items()}
        _write_table(temporary / SUMMARY_TABLE, [{key: row[key] for key in _SUMMARY} for row in summary], described)
        page = _page(summary, found, metrics, lost, folders | settings)
        (temporary / COMPARISON_PAGE).write_text(page, encoding="utf-8")
    return summary


def _dictionary(metrics: Mapping[str, Mapping], align: bool) -> dict[str, dict]:
    found = {
        "participant_id": {"Description": "The participant, such as sub-01"},
        "session_id": {"Description": "The session, such as ses-01"},
        "side": {"Description": "The hemisphere", "Levels": {"left": "left", "right": "right"}},
        "reconstructed": {"Description": "The file that is evaluated"},
        "reference": {"Description": "The file that it is compared with"},
    }
    if align:
        found[ICP_RESIDUE] = {"Description": "Root mean squared distance that the alignment leaves", "Units": "mm"}
    for name, metric in metrics.items():
        unit = {"Units": metric["unit"]} if metric["unit"] else {}
        found[name] = {"LongName": metric["name"], "Description": metric["definition"]} | unit
        found[f"{name}_floor"] = {"Description": f"{metric['name']} of the reference against itself"} | unit
    return found


def _write_table(path: Path, rows: list[dict], dictionary: dict) -> None:
    text = io.StringIO()
    writer = csv.writer(text, dialect="excel-tab", lineterminator="\n")
    writer.writerow(rows[0])
    writer.writerows([MISSING if value in (None, "") else value for value in row.values()] for row in rows)
    path.write_text(text.getvalue(), encoding="utf-8")
    described = json.dumps(dictionary, indent=1, ensure_ascii=False)
    path.with_suffix(".json").write_text(described + "\n", encoding="utf-8")


def _page(
    summary: list[dict], found: Mapping[Place, Compared], metrics: Mapping[str, Mapping], lost: list[str], said: dict
) -> str:
    tables = [
        {
            "side": side,
            "participants": rows[0]["participants"],
            "rows": [
                (row["name"], row["unit"], _interval(row, "mean"), _cell(row["floor"]), _interval(row, "difference"))
                for row in rows
            ],
        }
        for side in SIDES
        if (rows := [row for row in summary if row["side"] == side])
    ]
    return filled(
        "meshot/study/assets/compare.html",
        said=said,
        lost=lost,
        tables=tables,
        heads=[metric["name"] + (f" ({metric['unit']})" if metric["unit"] else "") for metric in metrics.values()],
        surfaces=[
            (str(place), [(_cell(m.value), _cell(m.floor)) for m in compared.evaluation.metrics()])
            for place, compared in found.items()
        ],
        definitions=[(metric["name"], metric["definition"]) for metric in metrics.values()],
    )


def _interval(row: Mapping, name: str) -> str:
    if row[f"{name}_low"] is None:
        return _cell(row[name])
    return f"{_cell(row[name])} [{_cell(row[f'{name}_low'])}, {_cell(row[f'{name}_high'])}]"


def _cell(value: float) -> str:
    """Three significant digits, at most four decimals, no exponent."""
    if abs(value) >= 1000:
        text = f"{value:,.0f}".replace(",", "\u202f")
    else:
        text = f"{value:.3g}" if abs(value) >= 0.001 else f"{value:.4f}"
    return "0" if float(text.replace("\u202f", "")) == 0 else text.replace("-", "−")
