"""Long runs that can be stopped and resumed. Results of other settings or other code are never reused."""

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
    """Results of ``work`` for each task, in order. Tasks that an earlier, stopped run finished are read from a file.

    A stored result is used only if none of these has changed, see :func:`fingerprint`: the task, the configuration,
    the Python files in the experiment's folder, and the Python files of the package. Other inputs, such as weights or
    scans, are not checked: put a digest of them into the task or the configuration. Stored results that do not match
    stay in the file, and are used again if configuration and code are changed back.
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
    """The tasks whose stored results :func:`run_jobs` would reuse."""
    stamp = fingerprint(folder, config)
    done = {_key(line["task"]) for line in _read(partial) if line["stamp"] == stamp}
    return [task for task in tasks if _key(task) in done]


def fingerprint(folder: Path, config: object) -> str:
    """Sixteen hexadecimal digits that depend on the settings and on all Python files of experiment and package.

    They are the start of the SHA-256 of the configuration and of the names and contents of all ``.py`` files. A changed
    comment therefore changes the result. Versions of other packages and the state of git do not matter.
    """
    total = hashlib.sha256(_key(config).encode())
    for root in (folder, PACKAGE):
        for path in sorted(root.rglob("*.py")):
            total.update(f"\n{path.relative_to(root).as_posix()}\n".encode() + path.read_bytes())
    return total.hexdigest()[:16]


def _key(task: object) -> str:
    return json.dumps(task, sort_keys=True)


def _read(partial: Path) -> list[dict]:
    """The finished tasks. An incomplete last line, left by a killed run, is dropped and removed from the file."""
    if not partial.exists():
        return []
    text = partial.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        with whole_file(partial) as temporary:
            temporary.write_text(whole, encoding="utf-8")
    return [json.loads(line) for line in whole.splitlines()]
