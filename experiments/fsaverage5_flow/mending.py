"""A chain of fitted legs without the crossings that they would make."""

import time

from surfaces import carried, cut_where_stretched

from meshot.flow.crossings import without_crossings
from meshot.flow.fitting import Leg
from meshot.mesh import Mesh
from meshot.mesh.topology import self_intersecting_faces


def mended_chain(leg: dict, legs: list[Leg], start: Mesh) -> tuple[list[Leg], Mesh, dict]:
    """The legs and the start, mended so that no faces cross after any leg, and what that took.

    ``leg`` holds the settings of the last one. First the start is cut where the chain stretches it, if there is a
    longest edge; faces that cross then are a matter of the flow, which comes to a standstill there, if there is a
    radius: in the earlier legs too, for the new faces have not been through them.
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
    """Every leg brought to a standstill where faces cross after it."""
    done: list[Leg] = []
    for leg in legs:
        field = without_crossings(leg.field, carried(done, start), leg.n_steps, radius=radius)
        done.append(Leg(field, leg.n_steps))
    return done


def crossings(legs: list[Leg], start: Mesh) -> int:
    """How many faces cross at the end of a chain."""
    return len(self_intersecting_faces(carried(legs, start)))
