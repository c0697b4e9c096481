"""Shares of intersecting faces as numbers of faces: the meaning of a bound in per cent for a mesh of a given size."""


def smallest_shares(face_counts: list[int], bound: float, n_scans: int) -> list[dict]:
    """The share in per cent of two faces, the smallest possible number, and the number that the bound allows."""
    rows = []
    for n_faces in face_counts:
        allowed = bound / 100 * n_faces
        rows.append(
            {
                "n_faces": n_faces,
                "smallest_nonzero_percent": 200 / n_faces,
                "faces_below_bound": allowed,
                "pairs_below_bound_over_scans": int(allowed * n_scans / 2),
                "smallest_nonzero_mean_percent": 200 / n_faces / n_scans,
            }
        )
    return rows


def faces_for(bound: float) -> float:
    """The number of faces from which a single intersecting pair is below the bound (in per cent)."""
    return 200 / bound


def factors(paper: dict, n_faces: int) -> list[dict]:
    """CortexODE's share divided by the bound, for each column, and its share as a number of faces."""
    rows = []
    for cohort, sides in paper["table_1"].items():
        for side, systems in sides.items():
            share = systems["CortexODE"][4][0]
            rows.append(
                {
                    "column": f"{cohort} {side}",
                    "cortexode_percent": share,
                    "cortexode_faces": share / 100 * n_faces,
                    "factor": share / paper["si_bound"],
                }
            )
    return rows
