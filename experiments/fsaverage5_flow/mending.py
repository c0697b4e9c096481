"""A fitted leg without the crossings that it would make."""

import time

from surfaces import carried, cut_where_stretched

from meshot.flow.chain import Leg
from meshot.flow.standstill import without_crossings
from meshot.mesh.intersection import self_intersecting_faces
from meshot.mesh.mesh import Mesh


def mended_leg(leg: dict, legs: list[Leg], last: Leg, start: Mesh) -> tuple[Leg, Mesh, dict]:
    """The last leg and the start, mended so that no faces cross, and what that took.

    First the start is cut where the chain stretches it, if the leg names a longest edge; faces that cross then are a
    matter of the flow, which comes to a standstill there, if the leg names a radius.
    """
    began = {"cpu": time.process_time(), "wall": time.perf_counter()}
    counts = {"fitted": crossings([*legs, last], start)}
    if "longest_edge" in leg:
        start = cut_where_stretched(start, [*legs, last], leg["longest_edge"])
        counts["cut"] = crossings([*legs, last], start)
    if "standstill" in leg:
        before = carried(legs, start)
        field = without_crossings(last.field, before, last.n_steps, radius=leg["standstill"])
        last = Leg(field, last.n_steps)
        counts["stilled"] = crossings([*legs, last], start)
    seconds = {"cpu": time.process_time() - began["cpu"], "wall": time.perf_counter() - began["wall"]}
    return last, start, {"crossings": counts, "n_faces": len(start.faces), "seconds": seconds}


def crossings(legs: list[Leg], start: Mesh) -> int:
    """How many faces cross at the end of a chain."""
    return len(self_intersecting_faces(carried(legs, start)))
