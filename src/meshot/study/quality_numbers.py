"""The columns of a quality page: the numbers of a study with robust scores."""

import dataclasses
import hashlib
import json
import math

import numpy as np

from meshot.statistics import OUTLIER_SCORE, robust_scores
from meshot.study.subjects_table import data_dictionary, surface_columns

#: Robust scores are computed if there are at least so many rows: fewer have no reliable median deviation.
FEWEST_SUBJECTS = 5
#: Stands for an infinite score where rows are sorted: JSON has no infinity.
_LARGEST = 1e6
#: Columns with scores. Seconds depend on the machine and its load, and have none.
_SCORED = (*surface_columns(), "warnings")
_THIN_SPACE = "\u202f"
_UNITS = {"mm": "(mm)", "mm2": "(mm²)", "mm3": "(mm³)"}


@dataclasses.dataclass(frozen=True, eq=False)
class QualityColumn:
    """One column: what is shown of every row, what it is sorted by, and its robust scores.

    Parameters
    ----------
    label, description : str
    texts : list of str
    sorted_as : list
        Numbers or strings; None for a missing value.
    scores : list of float
        NaN where there is none.
    """

    label: str
    description: str
    texts: list[str]
    sorted_as: list[float | str | None]
    scores: list[float]

    def is_odd(self, row: int) -> bool:
        """Whether the robust score of a row is beyond 3.5."""
        return abs(self.scores[row]) > OUTLIER_SCORE

    def score_text(self, row: int) -> str:
        """The robust score of a row, with its sign. It is infinite if most values of the column are equal."""
        score = self.scores[row]
        text = "∞" if math.isinf(score) else f"{abs(score):.1f}"
        return ("−" if score < 0 else "+") + text


def quality_columns(subjects: list[dict]) -> list[QualityColumn]:
    """All columns of the page: the name, the largest score, status, every number, and the verdict, which is empty.

    Parameters
    ----------
    subjects : list of dict
        As :func:`meshot.study.read_subjects` returns them.
    """
    known = data_dictionary()
    numbers = {
        name: np.array([np.nan if row.get(name) is None else row[name] for row in subjects], dtype=np.float64)
        for name in (*surface_columns(), "seconds", "warnings")
        if any(name in row for row in subjects)
    }
    scores = {name: _scores(name, values) for name, values in numbers.items()}
    names = [" ".join(filter(None, (row["participant_id"], row.get("session_id")))) for row in subjects]
    measured = [
        _numeric(_label(name), _description(known[name]), values, scores[name]) for name, values in numbers.items()
    ]
    return [
        _words("participant", "Participant and session", names),
        _largest(list(scores.values()), len(subjects)),
        _words("status", known["status"]["Description"], [row.get("status") or "" for row in subjects]),
        *measured,
        _words("verdict", "Given on this page", [""] * len(subjects)),
    ]


def row_key(subject: dict) -> str:
    """Twelve hexadecimal digits that change if the participant, the session or a number of the surfaces changes."""
    kept = {name: value for name, value in subject.items() if name not in ("seconds", "report")}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()[:12]


def _scores(name: str, values: np.ndarray) -> np.ndarray:
    known = np.count_nonzero(~np.isnan(values))
    return robust_scores(values) if name in _SCORED and known >= FEWEST_SUBJECTS else np.full(len(values), np.nan)


def _words(label: str, description: str, texts: list[str]) -> QualityColumn:
    return QualityColumn(label, description, texts, [text or None for text in texts], [math.nan] * len(texts))


def _numeric(label: str, description: str, values: np.ndarray, scores: np.ndarray) -> QualityColumn:
    known = [None if np.isnan(value) else float(value) for value in values]
    return QualityColumn(label, description, [_text(value) for value in known], known, scores.tolist())


def _largest(scores: list[np.ndarray], n_rows: int) -> QualityColumn:
    """The largest absolute score of each row, without a mark of its own."""
    found = np.full(n_rows, np.nan)
    for column in scores:
        found = np.fmax(found, np.abs(column))
    texts = ["" if np.isnan(value) else "∞" if np.isinf(value) else f"{value:.1f}" for value in found]
    sorted_as = [None if np.isnan(value) else min(float(value), _LARGEST) for value in found]
    return QualityColumn("largest |z|", "The largest robust z of the row", texts, sorted_as, [math.nan] * n_rows)


def _label(name: str) -> str:
    *words, unit = name.replace("_white", "").split("_")
    return " ".join([*words, _UNITS.get(unit, unit)])


def _description(entry: dict) -> str:
    return entry["Description"] + (f" ({entry['Units']})" if "Units" in entry else "")


def _text(value: float | None) -> str:
    if value is None:
        return ""
    if float(value).is_integer() or abs(value) >= 1000:
        return f"{round(value):,}".replace(",", _THIN_SPACE).replace("-", "−")
    return f"{value:.3g}".replace("-", "−")
