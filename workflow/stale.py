"""Say which results are out of date, vouch for them, and bring up to date what is made from them.

::

    python workflow/stale.py
    python workflow/stale.py vouch blur --reason "solver moved to another file"
    python workflow/stale.py update

A result is out of date if its settings, its inputs or its code are not those that it was made with. Settings are
compared by value, and code by what a run reaches: comments, docstrings and moves between files do not count. The
digests stand beside the result, in ``digests.json``.

``vouch`` is for an edit that changes no number. It runs a small part with the code of then and with that of now,
compares all numbers to six digits, and notes the new digests. If the history does not show the code of then by its
digests, ``--then`` names the commit. The reason is logged in ``experiments/vouched.jsonl``.
``update`` writes everything that is made from results: the chapters that read the changed ones, the ledger, README and
the pages on cost. ``update --list`` only says what it would write.
"""

import argparse
import contextlib
import dataclasses
import fcntl
import functools
import hashlib
import itertools
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TextIO

from reached import DIGITS, Code
from tasks import Graph, Task, read_graph

from meshot.files import write_whole
from meshot.provenance import provenance, rounded
from meshot.settings import read_yaml

ROOT = Path(__file__).resolve().parent.parent
NAME, LOG = "digests.json", "experiments/vouched.jsonl"
#: Set in the environment of a task of Snakemake, which notes digests when all is done.
NOTES = "MESHOT_NOTES"
#: The file in a folder that one process at a time has locked.
LOCK = "lock"
#: The small part of an experiment: the first of its tasks. Other tasks need ``--small``.
SMALL = "{command} --only 1 -o {{out}}/results.json"
#: The folder in which the runner keeps the states of tasks is called after settings and code.
STATES = re.compile(r"^partial/[0-9a-f]+/")
#: The inputs that a reason names. It counts the others.
FEW = 3
#: What differs from run to run.
UNLIKE = ("seconds", "stamp", "commit", "date", "command", "machine", "processor", "versions")


@dataclasses.dataclass(frozen=True, eq=False)
class Results:
    """A workflow in a checkout of the repository, as it is when this is made: every file is read once."""

    graph: Graph
    root: Path  # the repository
    state: Path  # the folder of finished tasks and of their output
    beside: bool = True  # whether the digests stand beside the results, or in the folder

    @functools.cached_property
    def entries(self) -> dict[str, dict]:
        """The digests with which results were made, by task."""
        files = sorted({self.kept(task) for task in self.graph.tasks.values()})
        return {name: entry for file in files for name, entry in _entries(file).items()}

    def kept(self, task: Task) -> Path:
        """The file with the digests of a task: in the folder of its experiment, if it has one."""
        if not self.beside:
            return self.state / NAME
        names = [Path(path).parts[1] for path in task.writes if path.startswith("experiments/")]
        return self.root.joinpath("experiments", *names[:1], NAME)

    def now(self, task: Task, planned: bool = False) -> dict:
        """The present digests of a task's settings and code, and the versions of what comes before it."""
        return {
            "settings": [self._value(read) for read in task.reads],
            "code": self._code(task.starts),
            "inputs": {up.name: self.version(up, planned) for up in self.before(task, planned)},
        }

    @functools.cache  # noqa: B019
    def _value(self, read: str) -> str:
        """The digest of a setting: of the values in YAML and JSON files, of the bytes of other files."""
        name, _, keys = read.partition("#")
        path = self.root / name
        if not path.is_file():
            return "missing"
        if path.suffix not in (".yaml", ".json"):
            return hashlib.sha256(path.read_bytes()).hexdigest()[:DIGITS]
        value = self._content(path)
        for key in filter(None, keys.split(".")):
            value = value.get(key) if isinstance(value, dict) else None
        return _digest(value)

    @functools.cache  # noqa: B019
    def _content(self, path: Path) -> object:
        return read_yaml(path) if path.suffix == ".yaml" else json.loads(path.read_text(encoding="utf-8"))

    @functools.cached_property
    def _source(self) -> Code:
        return Code(self.root / "src")

    @functools.cache  # noqa: B019
    def _code(self, starts: tuple[str, ...]) -> str:
        """The digest of the code that scripts and dotted names reach."""
        scripts = [self.root / start for start in starts if start.endswith(".py")]
        shared = Code(self.root / "experiments", self._source, "trials")  # the runner changes no number
        found = [Code(each.parent, shared).digest([each.stem]) for each in scripts if each.is_file()]
        names = [start for start in starts if not start.endswith(".py")]
        return _digest([*found, self._source.digest(names)] if names else found)

    @functools.cache  # noqa: B019
    def version(self, task: Task, planned: bool = False) -> str:
        """A digest that changes when a task is computed anew with other digests, and not when they are vouched for."""
        if task.name in self.entries and not self.changes(task, planned):
            return self.entries[task.name]["made"]
        return _digest(self.now(task, planned))

    @functools.cache  # noqa: B019
    def changes(self, task: Task, planned: bool = False) -> list[str]:
        """What has changed since a task was computed or vouched for."""
        if task.name not in self.entries:
            return ["it has no digests"] if task.writes else []
        was, now = self.entries[task.name], self.now(task, planned)
        pairs = itertools.zip_longest(was["settings"], now["settings"], task.reads)
        found = [f"{read or 'a setting that is gone'} has changed" for before, after, read in pairs if before != after]
        found += ["its code has changed"] if was["code"] != now["code"] else []
        names = dict.fromkeys([*now["inputs"], *was["inputs"]])
        others = [name for name in names if was["inputs"].get(name) != now["inputs"].get(name)]
        for name in others[:FEW]:
            # Tasks without a result are not in the list: why they have changed is said here.
            up = self.graph.tasks.get(name)
            why = self.changes(up, planned) if up and not up.writes else []
            found.append(f"{name} has changed" + (f" ({'; '.join(why)})" if why else ""))
        return found + ([f"{len(others) - FEW} more that it reads have changed"] if others[FEW:] else [])

    def before(self, task: Task, planned: bool = False) -> list[Task]:
        """The tasks that come before a task, without those that wait for a request unless there is one."""
        found = [self.graph.tasks[name] for name in task.after]
        return [up for up in found if planned or not self.is_planned(up)]

    def is_planned(self, task: Task) -> bool:
        """Whether a task waits for a request: it may be missing, and it is."""
        return task.planned and task.name not in self.entries and not all((self.root / p).exists() for p in task.writes)

    @functools.cache  # noqa: B019
    def reasons(self, task: Task, planned: bool = False) -> list[str]:
        """Why a result in the repository is out of date. The list is empty if it is not."""
        missing = [f"{path} is missing" for path in task.writes if not (self.root / path).exists()]
        if task.derived:
            before = (up for up in self.before(task, planned) if up.writes)
            news = [up.name for up in before if self.stamp(up, planned).is_file() or self.reasons(up, planned)]
            more = [f"{len(news) - FEW} more run"] if news[FEW:] else []
            return missing + [f"{name} runs" for name in news[:FEW]] + more
        return missing + self.changes(task, planned)

    def stale(self, planned: bool = False) -> dict[str, list[str]]:
        """The results in the repository that are out of date, and why."""
        there = (task for task in self.graph.tasks.values() if task.writes and (planned or not self.is_planned(task)))
        return {task.name: found for task in there if (found := self.reasons(task, planned))}

    def stamp(self, task: Task, planned: bool = False) -> Path:
        """The file that says that a task has ended with its present digests."""
        return self.state / task.stage / task.name / f"{self.version(task, planned)}.json"

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

    def note(self, tasks: Iterable[Task], planned: bool = False) -> None:
        """Note that these were computed with the present digests. What other processes have noted is kept."""
        self._write({task: self.now(task, planned) | {"made": self.version(task, planned)} for task in tasks})

    def vouch(self, tasks: Iterable[Task]) -> None:
        """Note the present digests of tasks whose numbers are those of before, so that nothing after them changes."""
        # In the order of the graph: what a task reads has its version of afterwards, also through tasks without files.
        chosen, after, entries = set(tasks), dataclasses.replace(self), {}
        for task in filter(chosen.__contains__, self.graph.tasks.values()):
            made = self.entries.get(task.name, {}).get("made", self.version(task))
            after.entries[task.name] = entries[task] = after.now(task) | {"made": made}
        self._write(entries)

    def _write(self, entries: dict[Task, dict]) -> None:
        with locked(self.state):
            for file in {self.kept(task) for task in entries}:
                new = {task.name: entry for task, entry in entries.items() if self.kept(task) == file}
                found = {k: v for k, v in sorted((_entries(file) | new).items()) if k in self.graph.tasks}
                lines = [f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in found.items()]
                write_whole(file, "{\n" + ",\n".join(lines) + "\n}\n")


def opened(graph: str = "experiments", root: Path = ROOT) -> Results:
    """A workflow of this folder in a checkout, by the name of its YAML file."""
    state = root / "build" / "workflow" / graph
    # Only the results of the experiments are in the repository.
    return Results(read_graph(root / "workflow" / f"{graph}.yaml", root), root, state, beside=graph == "experiments")


def note_written(path: Path, root: Path = ROOT) -> None:
    """Note the digests of the task that writes this file, if it is a result in the repository."""
    name = os.path.relpath(path, root).replace(os.sep, "/")
    if name.startswith("experiments/") and NOTES not in os.environ:
        results = opened(root=root)
        results.note([task for task in results.graph.tasks.values() if name in task.writes and not task.derived])


def code_of_script(script: Path, root: Path = ROOT) -> str:
    """The digest of the code that a script reaches, with what the tasks that call it name."""
    results, name = opened(root=root), os.path.relpath(script.resolve(), root).replace(os.sep, "/")
    more = [start for task in results.graph.tasks.values() if name in task.starts for start in task.code]
    return results._code((str(script.resolve()), *sorted(set(more))))


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[TextIO]:
    """Lock a folder, which is created if it is missing. If another process has locked it, wait until it is free.

    A process that inherits the descriptor of the lock, which is yielded, holds it, too.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield lock


def _entries(file: Path) -> dict[str, dict]:
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def _digest(value: object) -> str:
    # A record has been through JSON, in which keys are texts.
    same = json.loads(json.dumps(value))
    return hashlib.sha256(json.dumps(same, sort_keys=True).encode()).hexdigest()[:DIGITS]


def vouch_for(results: Results, names: list[str], reason: str, small: str, unchecked: bool, then: str) -> None:
    """Vouch for tasks: show that a small part of each has the numbers of before, note the digests, log the reason."""
    tasks = [task for task in results.graph.tasks.values() if task.name in names]
    for task in tasks:
        if gone := [path for path in task.writes if not (results.root / path).exists()]:
            raise ValueError(f"{task.name} has no {', '.join(gone)}; run it first")
    # What a part has shown holds for all tasks with the same code that name the same part.
    known: dict[tuple[str, str], str] = {}
    for group in [tasks] if unchecked else [[task] for task in tasks]:
        now = opened(results.state.name, results.root)  # with what has been vouched for before it
        if not (changed := [task for task in group if task.name not in now.entries or now.changes(task)]):
            print(f"{', '.join(task.name for task in group)}: nothing has changed")
            continue
        shown = "nothing was computed" if unchecked else compared(now, changed[0], small, then, known)
        now.vouch(changed)
        done = [task.name for task in changed]
        line = {"date": provenance()["date"], "names": done, "reason": reason, "shown": shown}
        with (results.root / LOG).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, ensure_ascii=False) + "\n")
        print(f"{', '.join(done)}: {shown}")


def compared(results: Results, task: Task, small: str, named: str, known: dict[tuple[str, str], str]) -> str:
    """Run a small part of a task with the code of its digests, or of a named commit, and with that of now; compare."""
    if "{out}" not in (small := small or SMALL.format(command=task.command)):
        raise ValueError(f"--small is {small}; it must write into the folder {{out}}")
    code = results.entries.get(task.name, {}).get("code", "")
    if (small, named or code) in known:
        return known[small, named or code]
    git = ["git", "-C", str(results.root)]
    find = ["log", "-1", "--format=%H", f"-S{code}", "--", str(results.kept(task))]
    look = [*git, *(["rev-parse", "--verify", f"{named}^{{commit}}"] if named else find)]
    commit = subprocess.run(look, capture_output=True, encoding="utf-8", check=False).stdout.strip()
    if not commit or not (code or named):
        raise ValueError(
            f"the history does not have {named or f'the code of {task.name}'}; run it whole, or fetch the history"
        )
    with tempfile.TemporaryDirectory() as place:
        old = Path(place, "then")
        subprocess.run([*git, "worktree", "add", "--detach", "-q", str(old), commit], check=True)
        try:
            if not named and Results(results.graph, old, results.state)._code(task.starts) != code:
                raise ValueError(
                    f"the digests of {task.name} were noted with changes after {commit}, or by another rule; "
                    "run it whole, or name the commit to compare with: --then COMMIT"
                )
            outs = []
            for root in (old, results.root):
                outs.append(Path(place, f"out{len(outs)}"))
                outs[-1].mkdir()
                words = shlex.split(small.replace("{out}", str(outs[-1])).replace("{cores}", "1"))
                paths = os.pathsep.join([str(root / "src"), os.environ.get("PYTHONPATH", "")])
                tools = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
                environment = os.environ | {"PYTHONPATH": paths, "PATH": tools}
                if subprocess.run(words, cwd=root, env=environment, check=False).returncode:
                    raise ValueError(f"{small} failed in {root}; name another part: --small 'COMMAND -o {{out}}/NAME'")
            then, now = (
                {
                    f"{STATES.sub('partial/', file.relative_to(out).as_posix())}{key}": value
                    for file in sorted(path for path in out.rglob("*") if path.is_file())
                    for key, value in numbers_of(file).items()
                }
                for out in outs
            )
        finally:
            subprocess.run([*git, "worktree", "remove", "--force", str(old)], check=True)
    count = len(then)
    if not count or then.keys() != now.keys():
        odd = sorted(then.keys() ^ now.keys())[:1] or ["nothing"]
        raise ValueError(f"{small} has left {count} values, and now {len(now)}; only one of both has {odd[0]}")
    if other := [place for place in then if then[place] != now[place]]:
        raise ValueError(f"{len(other)} of {count} values differ, such as {other[0]}: {task.name} must run anew")
    known[small, named or code] = f"{small}: all {count} values are those of {commit[:12]}"
    return known[small, named or code]


def numbers_of(file: Path) -> dict[str, object]:
    """All values in a file by their place, to six digits, without what differs from run to run."""
    if file.suffix == ".safetensors":
        from safetensors.numpy import load_file

        return {f"/{name}": value.tobytes() for name, value in load_file(file).items()}
    if file.suffix not in (".json", ".jsonl"):
        return {"": file.read_bytes()}

    def walked(value: object, place: str) -> Iterator[tuple[str, object]]:
        if isinstance(value, dict | list):
            for key, item in value.items() if isinstance(value, dict) else enumerate(value):
                if not any(word in str(key) for word in UNLIKE):
                    yield from walked(item, f"{place}/{key}")
        else:
            yield place, value

    lines = file.read_text(encoding="utf-8")
    return dict(
        walked(rounded([json.loads(x) for x in (lines.splitlines() if file.suffix == ".jsonl" else [lines])]), "")
    )


def behind(root: Path) -> tuple[list[str], list[str]]:
    """The experiments whose files have changed since the ledger was written, and the chapters that read them."""
    from meshot_book.notebook import CHECKSUMS, checksum_lines

    stated, found = CHECKSUMS.read_text(encoding="utf-8"), checksum_lines(root / "experiments")
    different = set(stated.splitlines()) ^ set(found.splitlines())
    changed = sorted({line.split("  ", 1)[1].partition("/")[0] for line in different})
    sources = sorted((root / "notebooks").glob("*.md"))
    texts = {source.stem: source.read_text(encoding="utf-8") for source in sources}
    texts = {name: text for name, text in texts.items() if "experiment_folder(" in text}
    return changed, [name for name, text in texts.items() if any(f'"{each}"' in text for each in changed)]


def update(root: Path, only_list: bool) -> int:
    """Write what is made from results. Returns the number of failed steps."""
    changed, chapters = behind(root)
    print(f"changed results: {', '.join(changed) or 'none'}; chapters that read them: {', '.join(chapters) or 'none'}")
    # The checksums, by which changes are seen, come after the chapters: what was stopped goes on.
    steps = [["book/run_notebooks.py", "store", *chapters]] if chapters else []
    pages = ("benchmarks/speed_page.py", "workflow/scaling.py", "tools/readme_numbers.py", "book/make_ledger.py")
    for step in [*steps, *([page] for page in pages)]:
        print("python", *step, flush=True)
        if not only_list and subprocess.run([sys.executable, *step], cwd=root, check=False).returncode:
            return 1
    return 0


def main(words: list[str] | None = None) -> int:
    """Do what is asked. Returns 1 if something failed, or a result is out of date."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["list", "vouch", "update"], nargs="?", default="list")
    parser.add_argument("names", nargs="*", metavar="TASK", help="for vouch: tasks, or all")
    parser.add_argument("--reason", help="for vouch: why no number changes")
    parser.add_argument("--small", metavar="COMMAND", default="", help="for vouch: a part that writes into {out}")
    parser.add_argument("--then", metavar="COMMIT", default="", help="for vouch: the code to compare with")
    parser.add_argument("--unchecked", action="store_true", help="for vouch: compute nothing, which the log says, too")
    parser.add_argument("--list", action="store_true", dest="only_list", help="for update: only say what it would do")
    parser.add_argument("--graph", default="experiments", help="the name of the YAML file (default: %(default)s)")
    parser.add_argument("--root", type=Path, default=ROOT, help="a checkout of the repository (default: this one)")
    parser.add_argument("--planned", action="store_true", help="with the tasks that have no result yet")
    asked = parser.parse_args(words)
    if asked.action == "vouch" and not (asked.names and asked.reason):
        parser.error("vouch needs a task and its --reason")
    try:
        if asked.action == "update":
            return update(asked.root, asked.only_list)
        results = opened(asked.graph, asked.root)
        stale = results.stale(asked.planned)
        if asked.action == "list":
            alike: dict[str, list[str]] = {}
            for name, reasons in stale.items():
                alike.setdefault("; ".join(reasons), []).append(name)
            for reason, names in alike.items():
                print(textwrap.fill(f"{', '.join(names)}: {reason}", 120, subsequent_indent="  "))
            print(f"{len(stale)} results are out of date" if stale else "nothing is stale")
            return int(bool(stale))
        tasks = results.graph.tasks.values()
        known = [task.name for task in tasks if not task.derived and not results.is_planned(task)]
        if unknown := sorted(set(asked.names) - {"all", *known}):
            raise ValueError(f"no result is called {', '.join(unknown)}; there are {', '.join(known)}")
        vouch_for(
            results,
            known if "all" in asked.names else asked.names,
            asked.reason,
            asked.small,
            asked.unchecked,
            asked.then,
        )
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
