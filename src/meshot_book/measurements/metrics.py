"""The metrics that experiments store for a surface, with their units in the names."""

from typing import Literal

from meshot.metrics import Evaluation

#: Names in the results, and in an evaluation.
METRICS = {
    "emd_mm": "emd", "swd_mm": "swd", "assd_mm": "assd", "hausdorff90_mm": "hausdorff", "normals": "normals",
    "crossing_faces": "intersecting_faces", "crossing_percent": "intersecting_share", "euler_number": "euler_number",
}  # fmt: skip
#: The metrics that two surfaces are compared by.
COMPARED = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm", "normals", "crossing_percent")


def metric_values(evaluation: Evaluation, what: Literal["value", "floor"] = "value") -> dict[str, float]:
    """The values of all metrics, or their floors, by their names in the results."""
    return {key: getattr(getattr(evaluation, name), what) for key, name in METRICS.items()}
