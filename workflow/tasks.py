"""The tasks of a workflow, read from a YAML file such as ``experiments.yaml``."""

import dataclasses
import fnmatch
import itertools
import re
from pathlib import Path

from meshot.settings import read_yaml

LISTS = ("reads", "after", "writes", "makes", "clears", "code")
KEYS = {"stage", "each", "trainings_of", "command", "copies", "planned", "derived", *LISTS}
RESOURCES = ("cores", "memory_mb", "minutes", "cuda")


@dataclasses.dataclass(frozen=True)
class Task:
    """One command of a workflow, with what it needs and what it leaves. All paths are relative to the repository.

    Parameters
    ----------
    name, stage, command : str
        ``{cores}`` in the command stands for the number of cores.
    reads : tuple of str
        The settings that the result depends on: files, or entries of a YAML file, such as ``a.yaml#arms.ddot``.
    after : tuple of str
        The tasks whose results are read.
    writes : tuple of str
        The files in the repository that the task leaves.
    makes : tuple of str
        The files outside the repository that the task leaves. They are made when another task needs them.
    clears : tuple of str
        Files and folders that are removed before the task starts with other settings than before.
    copies : tuple of pairs of str
        Files that are copied to their place in the repository when the command has ended.
    code : tuple of str
        Functions and classes that the command uses and no script names, such as ``meshot.pipeline.reconstruct``,
        or short names for them that the YAML file lists.
    planned : bool
        Whether the result may be missing. Such tasks run on request only.
    derived : bool
        Whether the task only rewrites a page from the results before it. It runs whenever one of those tasks runs.
    """

    name: str
    stage: str
    command: str
    reads: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    makes: tuple[str, ...] = ()
    clears: tuple[str, ...] = ()
    copies: tuple[tuple[str, str], ...] = ()
    code: tuple[str, ...] = ()
    planned: bool = False
    derived: bool = False

    @property
    def starts(self) -> tuple[str, ...]:
        """Where its code begins: the scripts of its command, and what its entry names."""
        return (*(word for word in self.command.split() if word.endswith(".py")), *self.code)


@dataclasses.dataclass(frozen=True)
class Graph:
    """The tasks of a workflow by name, each after those that it needs, and the resources of the stages."""

    tasks: dict[str, Task]
    stages: dict[str, dict[str, int]]


def read_graph(path: Path, root: Path) -> Graph:
    """Read a workflow from its YAML file. ``trainings_of`` names a protocol in the repository, which is ``root``."""
    content = read_yaml(path)
    for stage, found in content["stages"].items():
        if set(found) != set(RESOURCES):
            raise ValueError(f"{path}: the stage {stage} states {', '.join(found)}; state {', '.join(RESOURCES)}")
    tasks: dict[str, Task] = {}
    for pattern, entry in content["tasks"].items():
        if strange := sorted(set(entry) - KEYS):
            raise ValueError(f"{path}: {pattern} has {', '.join(strange)}; possible are {', '.join(sorted(KEYS))}")
        if entry["stage"] not in content["stages"]:
            raise ValueError(f"{path}: {pattern} has the unknown stage {entry['stage']}; add it to the stages")
        for values in _values(entry, root):
            task = _task(pattern, entry, values, content.get("code", {}))
            if task.name in tasks:
                raise ValueError(f"{path}: there are two tasks {task.name}; give one another name")
            tasks[task.name] = task
    for task in tasks.values():
        # Names in place of patterns such as cohort_*, and of stages such as @cohort.
        after: dict[str, None] = {}
        for pattern in task.after:
            fit = [n for n, t in tasks.items() if fnmatch.fnmatchcase(n, pattern) or f"@{t.stage}" == pattern]
            if not (names := [name for name in fit if name != task.name]):
                raise ValueError(f"{path}: {task.name} comes after {pattern}, which is no task; correct the name")
            after |= dict.fromkeys(names)
        tasks[task.name] = dataclasses.replace(task, after=tuple(after))
    done: dict[str, Task] = {}
    while len(done) < len(tasks):
        ready = [task for name, task in tasks.items() if name not in done and all(up in done for up in task.after)]
        if not ready:
            left = ", ".join(name for name in tasks if name not in done)
            raise ValueError(f"{path}: tasks wait for each other among {left}; remove one of their entries in after")
        done |= {task.name: task for task in ready}
    return Graph(done, content["stages"])


def _values(entry: dict, root: Path) -> list[dict[str, str]]:
    """The values of the placeholders, for every task of an entry."""
    if "trainings_of" in entry:
        return _trainings(read_yaml(root / entry["trainings_of"]))
    each = entry.get("each", {})
    return [dict(zip(each, map(str, values))) for values in itertools.product(*each.values())]


def _trainings(config: dict) -> list[dict[str, str]]:
    """The combinations in the groups of a protocol, each once: see ``experiments/trials/training.py``."""
    found = {}
    for group in config["groups"].values():
        for values in itertools.product(group["cohorts"], group["sides"], group["arms"], group["seeds"]):
            cohort, side, arm, seed = map(str, values)
            side = "both" if config["arms"][arm].get("both_sides") else side
            training = "_".join(filter(None, (cohort, side, arm, group.get("budget"), seed)))
            place = {"training": training, "cohort": cohort, "arm": arm, "settings": config["settings"]}
            found[training] = place | {"system": config["arms"][arm].get("system", arm)}
    return list(found.values())


def _task(pattern: str, entry: dict, values: dict[str, str], code: dict[str, str]) -> Task:
    def filled(text: str) -> str:
        return re.sub(r"\{(\w+)\}", lambda found: values.get(found[1], found[0]), text)

    lists = {key: tuple(map(filled, entry.get(key, ()))) for key in LISTS}
    lists["code"] = tuple(code.get(name, name) for name in lists["code"])
    copies = tuple((filled(start), filled(end)) for start, end in entry.get("copies", ()))
    command = " ".join(filled(entry["command"]).split())
    kind = {key: entry.get(key, False) for key in ("planned", "derived")}
    return Task(filled(pattern), entry["stage"], command, copies=copies, **kind, **lists)
