"""A session of cosmic-ray: a sample drawn from it, and the mutants that survived."""

import dataclasses
from pathlib import Path

import numpy as np
import yaml

KNOWN = Path(__file__).resolve().parent / "survivors.yaml"


@dataclasses.dataclass(frozen=True)
class Mutant:
    """A change that no test has seen.

    Parameters
    ----------
    file : str
        From the top of the checkout.
    line : int
    operator : str
        What cosmic-ray changed.
    text, change : str
        The line before the change and after it, without indentation.
    """

    file: str
    line: int
    operator: str
    text: str
    change: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What names it, even after lines were added above."""
        return self.file, self.text, self.change


def known_survivors(path: Path = KNOWN) -> dict[tuple[str, str, str], str]:
    """The reason for each survivor that was looked at.

    Raises
    ------
    ValueError
        If one has no reason.
    """
    entries = yaml.safe_load(path.read_text(encoding="utf-8")) or []
    poor = [entry for entry in entries if not entry.get("why")]
    if poor:
        raise ValueError(f"{path.name} gives no reason for {poor[0]}: say why no test can see it")
    return {(entry["file"], entry["text"], entry["change"]): entry["why"] for entry in entries}


def stale(known: dict[tuple[str, str, str], str], root: Path) -> list[tuple[str, str, str]]:
    """Entries whose line is no longer in its file."""

    def lines(file: str) -> set[str]:
        path = root / file
        return {line.strip() for line in path.read_text(encoding="utf-8").splitlines()} if path.is_file() else set()

    return [key for key in known if key[1] not in lines(key[0])]


def sampled(session: Path, n: int, random: np.random.Generator) -> int:
    """Leave ``n`` mutants of a session to be tried, drawn at random, and skip all others; how many there are."""
    from cosmic_ray.work_db import use_db
    from cosmic_ray.work_item import WorkerOutcome, WorkResult

    with use_db(session) as database:
        found = {str(item.mutations): item.job_id for item in database.work_items}
        items = [found[mutations] for mutations in sorted(found)]  # by what is changed: identifiers differ every time
        kept = {items[k] for k in random.permutation(len(items))[:n]}
        skipped = WorkResult(WorkerOutcome.SKIPPED, output="not in the sample")
        database.set_multiple_results([job for job in items if job not in kept], skipped)
    return len(items)


def survivors_of(session: Path) -> tuple[list[Mutant], int]:
    """The mutants of a session that survived, and how many were tried."""
    from cosmic_ray.work_db import use_db
    from cosmic_ray.work_item import TestOutcome, WorkerOutcome

    found, n_tried = [], 0
    with use_db(session) as database:
        for item, result in database.completed_work_items:
            if result.worker_outcome is not WorkerOutcome.NORMAL:
                continue
            n_tried += 1
            if result.test_outcome is TestOutcome.SURVIVED:
                (mutation,) = item.mutations
                file, line = Path(mutation.module_path).as_posix(), mutation.start_pos[0]
                rows = [row for row in (result.diff or "").splitlines() if row[:2] not in ("--", "++")]
                text, change = (" ".join(row[1:].strip() for row in rows if row[:1] == sign) for sign in "-+")
                found.append(Mutant(file, line, mutation.operator_name, text, change))
    return found, n_tried
