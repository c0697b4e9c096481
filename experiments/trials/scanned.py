"""One scan as all trained systems get it, and the white surfaces that a system finds."""

import dataclasses
import time

from meshot.anatomy import HEMISPHERES
from meshot.files import write_whole
from meshot.mesh import Mesh
from meshot.pipeline import InitialSurfaces, in_scanner
from meshot.synth import Subject
from meshot.systems import Scan, SurfaceSystem
from meshot.volume import StandardScan

#: The arm of the initial surface.
INITIAL = "initial"

#: Surfaces by side in scanner space, or why there are none, and the processor seconds of one side.
Found = tuple[dict[str, Mesh] | str, float | None]


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """One scan: on the standard grid, with the initial surfaces of both sides, and the true ones in scanner space."""

    scan: StandardScan
    initial: dict[str, Mesh]
    truths: dict[str, Mesh]
    seconds: float | None

    def given(self, system: type[SurfaceSystem]) -> Scan:
        """The input of a system."""
        return Scan(self.scan.volume, {key: self.initial[key[0]] for key in system.needs})


def seen(subject: Subject, surfaces: InitialSurfaces) -> Seen:
    """Read one scan. Initial surfaces that do not exist are computed; their seconds are those of one side.

    The seconds are stored beside the surfaces. Without the file there are none for surfaces that exist.
    """
    scan, started = subject.standard(), time.process_time()
    surface = surfaces.path(subject, "left", scan)
    there, file = surface.is_file(), surface.with_name(f"{surface.name}.seconds")
    initial = {side: surfaces.of(subject, side) for side in HEMISPHERES}
    if not there:
        write_whole(file, repr((time.process_time() - started) / len(HEMISPHERES)))
    seconds = float(file.read_text(encoding="utf-8")) if file.is_file() else None
    return Seen(scan, initial, {side: subject.surface("white", side) for side in HEMISPHERES}, seconds)


def reconstructed(scan: Seen, system: SurfaceSystem | None) -> Found:
    """The white surfaces of a system, without the repair of crossing faces; without a system, of the segmentation."""
    if system is None:
        return {side: in_scanner(mesh, scan.scan) for side, mesh in scan.initial.items()}, scan.seconds
    started = time.process_time()
    try:
        found = system.reconstruct(scan.given(type(system)))
    except ValueError as error:
        return str(error), None
    seconds = time.process_time() - started
    white = {side: in_scanner(mesh, scan.scan) for (side, kind), mesh in found.items() if kind == "white"}
    return white, seconds / len(white)
