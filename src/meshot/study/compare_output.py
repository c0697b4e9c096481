"""A folder of surfaces compared with another: tables, data dictionaries and a page, in a folder of their own."""

import csv
import io
import json
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from meshot.files import printable_name, whole_folder
from meshot.provenance import provenance
from meshot.study.compare_files import Place, find_surfaces, paired_surfaces
from meshot.study.compare_rows import SIDES, Compared, compared_pairs, summary_rows
from meshot.view import filled

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
        rows = [_surface_row(place, pairs[place], compared) for place, compared in found.items()]
        _write_table(
            temporary / SURFACES_TABLE,
            rows,
            _dictionary(metrics, align) | {"meshot": folders | settings | provenance()},
        )
        described = {name: {"Description": text} for name, text in _SUMMARY.items()}
        _write_table(temporary / SUMMARY_TABLE, [{key: row[key] for key in _SUMMARY} for row in summary], described)
        page = _page(summary, found, metrics, lost, folders | settings)
        (temporary / COMPARISON_PAGE).write_text(page, encoding="utf-8")
    return summary


def _surface_row(place: Place, paths: tuple[Path, Path], compared: Compared) -> dict:
    row = {"participant_id": place.participant, "session_id": place.session, "side": place.side}
    row |= dict(zip(("reconstructed", "reference"), map(printable_name, paths), strict=True))
    if compared.residue is not None:
        row |= {ICP_RESIDUE: compared.residue}
    for name, metric in compared.evaluation.as_dict().items():
        row |= {name: metric["value"], f"{name}_floor": metric["floor"]}
    return row


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
