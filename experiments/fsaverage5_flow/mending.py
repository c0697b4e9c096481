"""Repair of a sequence of fitted flows that would cause self-intersections."""

import time

from surfaces import carried, cut_where_stretched

from meshot.mesh import Mesh, self_intersecting_faces
from meshot_book.flows import Leg, without_crossings


def mended_chain(leg: dict, legs: list[Leg], start: Mesh) -> tuple[list[Leg], Mesh, dict]:
    """The legs and the start after repair, so that there are no self-intersections after any leg; and a record of it.

    ``leg`` has the settings of the last one. If it sets a longest edge, edges of the start that the sequence stretches
    are first divided. If it sets a radius, the flows are damped where faces still intersect, in earlier legs too,
    because the new faces have not been checked in them.
    """
    began = {"cpu": time.process_time(), "wall": time.perf_counter()}
    counts = {"fitted": crossings(legs, start)}
    if "longest_edge" in leg:
        start = cut_where_stretched(start, legs, leg["longest_edge"])
        counts["cut"] = crossings(legs, start)
    if "standstill" in leg:
        legs = stilled_chain(legs, start, leg["standstill"])
        counts["damped"] = crossings(legs, start)
    seconds = {"cpu": time.process_time() - began["cpu"], "wall": time.perf_counter() - began["wall"]}
    return legs, start, {"crossings": counts, "n_faces": len(start.faces), "seconds": seconds}


def stilled_chain(legs: list[Leg], start: Mesh, radius: float) -> list[Leg]:
    """All legs, damped where faces intersect after them."""
    done: list[Leg] = []
    for leg in legs:
        field = without_crossings(leg.field, carried(done, start), leg.n_steps, radius=radius)
        done.append(Leg(field, leg.n_steps))
    return done


def crossings(legs: list[Leg], start: Mesh) -> int:
    """The number of self-intersecting faces at the end of a sequence."""
    return len(self_intersecting_faces(carried(legs, start)))
