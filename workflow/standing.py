"""For which settings a result stands: by their content, not by the times of files.

The **fingerprint** of a task is a digest of the settings that it reads and of the fingerprints of the tasks before it.
Comments, the order of keys and the code do not matter. ``standing.json`` holds, for every result in the repository, the
settings and fingerprints with which it was made. A result is out of date if one of them has changed, or if a file is
missing. Where a record states the whole configuration, the record itself is compared.
"""

import contextlib
import dataclasses
import fcntl
import functools
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from tasks import Graph, Task

from meshot.files import whole_file
from meshot.settings import read_yaml

#: The file in a folder that one process at a time has locked.
LOCK = "lock"
#: Missing settings differ from all others.
MISSING = "missing"
DIGITS = 16


@dataclasses.dataclass(frozen=True, eq=False)
class Standing:
    """A workflow in a checkout of the repository, as it is when this is made: every file is read once.

    Parameters
    ----------
    graph : Graph
    root : path
        The repository.
    state : path
        The folder of finished tasks and of their output.
    kept : path
        The file that says for which settings the results stand.
    """

    graph: Graph
    root: Path
    state: Path
    kept: Path

    @functools.cached_property
    def entries(self) -> dict[str, dict]:
        """The content of the file."""
        return self._read_entries()

    def _read_entries(self) -> dict[str, dict]:
        return json.loads(self.kept.read_text(encoding="utf-8")) if self.kept.is_file() else {}

    @functools.cache  # noqa: B019
    def inputs(self, task: Task, planned: bool = False) -> dict[str, dict[str, str]]:
        """The digests of the settings of a task, and the fingerprints of the tasks before it."""
        return {
            "reads": {read: self.digest(read) for read in task.reads},
            "after": {up.name: self.fingerprint(up, planned) for up in self.before(task, planned)},
        }

    def before(self, task: Task, planned: bool = False) -> list[Task]:
        """The tasks that come before a task, without those that wait for a request unless there is one."""
        found = [self.graph.tasks[name] for name in task.after]
        return [up for up in found if planned or not self.is_planned(up)]

    def _has_news(self, task: Task, planned: bool) -> bool:
        return bool(task.writes) and (self.stamp(task, planned).is_file() or bool(self.reasons(task, planned)))

    @functools.cache  # noqa: B019
    def digest(self, read: str) -> str:
        """The digest of a setting: of the values in YAML and JSON files, of the bytes of other files."""
        name, _, keys = read.partition("#")
        path = self.root / name
        if not path.is_file():
            return MISSING
        if path.suffix not in (".yaml", ".json"):
            return hashlib.sha256(path.read_bytes()).hexdigest()[:DIGITS]
        value = self._content(path)
        for key in filter(None, keys.split(".")):
            value = value.get(key) if isinstance(value, dict) else None
        return _digest(value)

    @functools.cache  # noqa: B019
    def _content(self, path: Path) -> object:
        return read_yaml(path) if path.suffix == ".yaml" else json.loads(path.read_text(encoding="utf-8"))

    @functools.cache  # noqa: B019
    def fingerprint(self, task: Task, planned: bool = False) -> str:
        """The digest of all that a task depends on."""
        return _digest(self.inputs(task, planned))

    def is_planned(self, task: Task) -> bool:
        """Whether a task waits for a request: it may be missing, and it is."""
        return task.planned and task.name not in self.entries and not all((self.root / p).exists() for p in task.writes)

    @functools.cache  # noqa: B019
    def reasons(self, task: Task, planned: bool = False) -> list[str]:
        """Why a result in the repository is out of date. The list is empty if it is not."""
        missing = [f"{path} is missing" for path in task.writes if not (self.root / path).exists()]
        if task.derived:
            return missing + [f"{up.name} runs" for up in self.before(task, planned) if self._has_news(up, planned)]
        entry, now = self.entries.get(task.name, {}), self.inputs(task, planned)
        stood = {"reads": dict(entry.get("reads", {})), "after": entry.get("after", {})}
        if task.record and (self.root / task.record).is_file():
            stood["reads"][task.reads[0]] = self.digest(f"{task.record}#config")
        found = missing
        for key, word in (("reads", "has changed"), ("after", "has other settings")):
            names = dict.fromkeys([*now[key], *stood[key]])
            found += [f"{name} {word}" for name in names if now[key].get(name) != stood[key].get(name)]
        return found

    def stamp(self, task: Task, planned: bool = False) -> Path:
        """The file that says that a task has ended with its present settings."""
        return self.state / task.stage / task.name / f"{self.fingerprint(task, planned)}.json"

    def stale(self, planned: bool = False) -> dict[str, list[str]]:
        """The results in the repository that are out of date, and why."""
        found = {
            name: self.reasons(task, planned)
            for name, task in self.graph.tasks.items()
            if task.writes and (planned or not self.is_planned(task))
        }
        return {name: reasons for name, reasons in found.items() if reasons}

    def needed(self, task: Task, planned: bool = False) -> list[Path]:
        """The stamps that a task waits for: of what is outside the repository, and of results that are out of date."""
        before = self.before(task, planned)
        return [self.stamp(up, planned) for up in before if not up.writes or self.reasons(up, planned)]

    def drop_false_stamps(self) -> None:
        """Remove the stamps of tasks whose files are gone."""
        for task in self.graph.tasks.values():
            if not all((self.root / path).exists() for path in (*task.writes, *task.makes)):
                for stamp in (self.state / task.stage / task.name).glob("*.json"):
                    stamp.unlink()

    def stand(self, names: dict[str, dict]) -> None:
        """Note that results stand for these inputs. Entries of tasks that are gone are removed.

        What other processes have noted meanwhile is kept.
        """
        with locked(self.state):
            entries = self._read_entries() | names
            found = {name: entry for name, entry in entries.items() if name in self.graph.tasks}
            with whole_file(self.kept) as temporary:
                temporary.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[TextIO]:
    """Lock a folder, which is created if it is missing. If another process has locked it, wait until it is free.

    Yields
    ------
    text file
        Its lock. A process that inherits its descriptor holds the lock, too.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield lock


def _digest(value: object) -> str:
    # A record has been through JSON, in which keys are texts.
    same = json.loads(json.dumps(value))
    return hashlib.sha256(json.dumps(same, sort_keys=True).encode()).hexdigest()[:DIGITS]
