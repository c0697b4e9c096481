"""Long runs that go on where they were stopped, and never with what other settings or other code have found."""

import hashlib
import json
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

from tqdm import tqdm

from meshot.files import naming_a_full_disk, whole_file
from meshot.provenance import PACKAGE


def run_jobs(
    tasks: Iterable[object],
    work: Callable[[object], object],
    partial: Path,
    *,
    folder: Path,
    config: object,
    clock: Callable[[], float] = time.perf_counter,
) -> list[dict]:
    """What ``work`` finds for each of the tasks, in their order: those of a stopped run are read, not done again.

    A finished task is stale, and is done anew, if anything of these has changed since, see :func:`fingerprint`: the
    task itself, the configuration, a Python file of the experiment's folder, a Python file of the package. What the
    work reads besides, such as weights or scans, is not seen: put a digest of it into the task or the configuration.
    Stale lines stay in the file, so that they count again when configuration and code are as they were.

    Parameters
    ----------
    tasks : iterable
        Each one JSON: it names what was done.
    work : callable
        From a task to what is found, JSON too. A task done now and one that is read give the same.
    partial : path
        Where finished tasks are kept, one line each; its folder is made. Remove it once the results are written.
    folder : path
        The experiment: the folder of its scripts.
    config : JSON
        Every setting that the work depends on.
    clock : callable
        Seconds: of the wall, or ``time.process_time``.

    Returns
    -------
    list of dict
        ``task``, ``found`` and ``seconds`` of each.

    Raises
    ------
    TypeError
        If a task, the configuration, or what is found, is not JSON.
    """
    stamp = fingerprint(folder, config)
    lines = _read(partial)
    done = {_key(line["task"]): line for line in lines if line["stamp"] == stamp}
    if len(done) < len(lines):
        warnings.warn(
            f"{partial.name} holds {len(lines) - len(done)} tasks that another configuration or other code has done: "
            "they are not used",
            stacklevel=2,
        )
    partial.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for task in tqdm(list(tasks), desc=folder.name, unit="task"):
        key = _key(task)
        if key not in done:
            started = clock()
            found = work(task)
            line = json.dumps({"task": task, "stamp": stamp, "found": found, "seconds": clock() - started})
            with naming_a_full_disk(partial), partial.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
            done[key] = json.loads(line)
        rows.append({"task": task, "found": done[key]["found"], "seconds": done[key]["seconds"]})
    return rows


def finished_tasks(tasks: Iterable[object], partial: Path, *, folder: Path, config: object) -> list[object]:
    """Those of the tasks that :func:`run_jobs` would not do again."""
    stamp = fingerprint(folder, config)
    done = {_key(line["task"]) for line in _read(partial) if line["stamp"] == stamp}
    return [task for task in tasks if _key(task) in done]


def fingerprint(folder: Path, config: object) -> str:
    """Sixteen digits that change with a setting, or with a Python file of the experiment or of the package.

    SHA-256 of the configuration and of the names and contents of all ``.py`` files: comments count, versions of other
    packages do not, and git is not asked.

    Raises
    ------
    TypeError
        If the configuration is not JSON.
    """
    total = hashlib.sha256(_key(config).encode())
    for root in (folder, PACKAGE):
        for path in sorted(root.rglob("*.py")):
            total.update(f"\n{path.relative_to(root).as_posix()}\n".encode() + path.read_bytes())
    return total.hexdigest()[:16]


def _key(task: object) -> str:
    return json.dumps(task, sort_keys=True)


def _read(partial: Path) -> list[dict]:
    """The finished lines; a last one that a kill cut short is dropped, from the file as well."""
    if not partial.exists():
        return []
    text = partial.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        with whole_file(partial) as temporary:
            temporary.write_text(whole, encoding="utf-8")
    return [json.loads(line) for line in whole.splitlines()]
