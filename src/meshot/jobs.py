"""Long runs that go on where they were stopped."""

import json
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from tqdm import tqdm

from meshot.files import whole_file


def run_jobs(
    tasks: Iterable[object],
    work: Callable[[object], object],
    partial: Path,
    clock: Callable[[], float] = time.perf_counter,
) -> list[dict]:
    """What ``work`` finds for each of the tasks, in their order: those of a stopped run are read, not done again.

    Parameters
    ----------
    tasks : iterable
        Each one JSON: it names what was done.
    work : callable
        From a task to what is found, JSON too. A task done now and one that is read give the same.
    partial : path
        Where finished tasks are kept, one line each; its folder is made. Remove it once the results are written.
    clock : callable
        Seconds: of the wall, or ``time.process_time``.

    Returns
    -------
    list of dict
        ``task``, ``found`` and ``seconds`` of each.

    Raises
    ------
    TypeError
        If a task, or what is found, is not JSON.
    """
    done = _read(partial)
    partial.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for task in tqdm(list(tasks)):
        key = json.dumps(task, sort_keys=True)
        if key not in done:
            started = clock()
            found = work(task)
            line = json.dumps({"key": key, "found": found, "seconds": clock() - started})
            with partial.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
            done[key] = json.loads(line)
        rows.append({"task": task, "found": done[key]["found"], "seconds": done[key]["seconds"]})
    return rows


def _read(partial: Path) -> dict[str, dict]:
    """The finished lines by key; a last one that a kill cut short is dropped, from the file as well."""
    if not partial.exists():
        return {}
    text = partial.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        with whole_file(partial) as temporary:
            temporary.write_text(whole, encoding="utf-8")
    return {line["key"]: line for line in map(json.loads, whole.splitlines())}
