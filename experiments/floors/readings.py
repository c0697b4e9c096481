"""The value of "EMD" for a perfect surface, under each interpretation of the term."""

import math
from pathlib import Path

import yaml

PAPER = Path(__file__).resolve().parents[1] / "paper_table" / "paper.yaml"


def paper_number() -> float:
    """The smallest EMD (mm) in the paper for its own system on ADNI, where EMD is larger than SWD."""
    table = yaml.safe_load(PAPER.read_text(encoding="utf-8"))["table_1"]["ADNI"]
    return min(table[side]["DDOT"][0][0] for side in ("left", "right"))


def emd_readings(floors: list[dict], from_m: int) -> list[dict]:
    """Each interpretation with its floor at the target size: the union of the intervals of models and surfaces."""
    w2 = _exact_ends(floors)
    rows = [
        _reading("exact W₂", w2, "mm"),
        _reading("exact W₁", _scaled(w2, floors, "exact_w1", {}), "mm"),
        _reading("the root of half the squared cost, √(½ W₂²)", [end / math.sqrt(2) for end in w2], "mm"),
        _reading("half the squared cost, ½ W₂²", [end**2 / 2 for end in w2], "mm²"),
    ]
    for name, setting in (("in mm", {"blur_mm": 0.05}), ("in [-1, 1]", {"blur": 0.05})):
        ends = _scaled(w2, floors, "sinkhorn", setting | {"debias": True})
        rows.append(_reading(f"GeomLoss, its default blur of 0.05 {name}, doubled and rooted", ends, "mm"))
    for row, metric in zip(rows, ["exact_w2", "exact_w1", "exact_w2", "exact_w2", "sinkhorn", "sinkhorn"]):
        largest = max(m["m"] for floor in floors if floor["metric"] == metric for m in floor["measured"])
        row["how"] = f"extrapolated from {from_m} to {largest} points"
        row["how"] += "" if metric == "exact_w2" else ", as a ratio to exact W₂"
    return rows


def _exact_ends(floors: list[dict]) -> list[float]:
    laws = [
        law
        for row in floors
        if row["metric"] == "exact_w2" and row["surface"].startswith("white")
        for law in row["at_target"].values()
    ]
    return [min(law["low"] for law in laws), max(law["high"] for law in laws)]


def _scaled(w2: list[float], floors: list[dict], metric: str, setting: dict) -> list[float]:
    """The ends for a metric measured with fewer points, from its ratio to exact W₂ on the same samples."""
    (row,) = [row for row in floors if (row["metric"], row["setting"]) == (metric, setting)]
    ratio = row["ratio_at_target"]
    return [w2[0] * ratio["low"], w2[1] * ratio["high"]]


def _reading(name: str, ends: list[float], unit: str) -> dict:
    return {"reading": name, "low": ends[0], "high": ends[1], "unit": unit}
