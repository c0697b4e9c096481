"""Run one task of a workflow, which is what Snakemake calls.

::

    python workflow/run_task.py run ddot --cores 1
    python workflow/run_task.py collect

``run`` runs the command of a task and writes its stamp. ``collect`` notes the digests of the results whose stamps are
there.
"""

import argparse
import contextlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from stale import NOTES, ROOT, Results, locked, opened
from tasks import Task

from meshot.files import whole_file, write_whole

STARTED = "started.txt"
#: Ends a process group when its input ends without a line.
GUARD = 'read line || kill -s TERM -- "-$0"'


def yes_or_no(name: str, value: object) -> bool:
    """The value of a setting of Snakemake, which is a truth value or a text."""
    found = {"yes": True, "true": True, "no": False, "false": False}.get(str(value).lower())
    if found is None:
        raise ValueError(f"{name} is {value}; it is yes, no, true or false: --config {name}=yes")
    return found


def run(results: Results, task: Task, cores: int, planned: bool) -> None:
    """Run a task and write its stamp. Of two processes that run the same task, the second waits for the first.

    If this process is ended, by whatever signal, its command is terminated. The command holds the lock of the task,
    too: while it goes on, nobody starts it again.
    """
    stamp = results.stamp(task, planned)
    with locked(stamp.parent) as lock:
        if stamp.is_file():
            return
        for other in stamp.parent.glob("*.json"):
            other.unlink()
        clear_other(results, task, stamp)
        _call(task, cores, results.root, lock.fileno())
        for start, end in task.copies:
            with whole_file(results.root / end) as temporary:
                shutil.copyfile(results.root / start, temporary)
        if gone := [path for path in (*task.writes, *task.makes) if not (results.root / path).exists()]:
            raise ValueError(f"{task.name} ended without {', '.join(gone)}; correct its command, or its entry")
        now = Results(results.graph, results.root, results.state, results.beside)
        if now.stamp(task, planned) != stamp:
            raise ValueError(f"the settings of {task.name} changed while it ran; start again")
        write_whole(stamp, json.dumps(now.now(task, planned)))


def clear_other(results: Results, task: Task, stamp: Path) -> None:
    """Remove what an earlier start of the task with other settings has left."""
    started = stamp.parent / STARTED
    if started.is_file():
        other = started.read_text(encoding="utf-8") != stamp.stem
    else:
        other = task.name in results.entries and any("missing" not in reason for reason in results.reasons(task))
    for path in [results.root / name for name in task.clears] if other else []:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    write_whole(started, stamp.stem)


def _call(task: Task, cores: int, root: Path, lock: int) -> None:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), str(cores))
    tools = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    environment = os.environ | threads | {"PATH": tools, NOTES: "later"}
    command = task.command.replace("{cores}", str(cores))
    print(command, flush=True)
    running = subprocess.Popen(
        command, shell=True, cwd=root, env=environment, pass_fds=[lock], start_new_session=True
    )  # fmt: skip
    with running, _ended_with_this_process(running.pid):
        status = running.wait()
    if status:
        raise ValueError(f"{task.name} failed with exit status {status}; its output is above")


@contextlib.contextmanager
def _ended_with_this_process(group: int) -> Iterator[None]:
    """Terminate a process group if the block raises, or if this process is killed in it."""
    guard = subprocess.Popen(
        ["sh", "-c", GUARD, str(group)], stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    with guard:  # closes its input
        yield
        guard.communicate(b"\n")


def collect(results: Results, planned: bool) -> None:
    """Note the digests of what has been made, and remove the stamps of results in the repository."""
    ended = {
        name: stamp for name, task in results.graph.tasks.items() if (stamp := results.stamp(task, planned)).is_file()
    }
    tasks = [results.graph.tasks[name] for name in ended]
    results.note([task for task in tasks if not task.derived], planned)
    for task in tasks:
        if task.writes:
            ended[task.name].unlink()


def main(words: list[str] | None = None) -> int:
    """Do what is asked. Returns 1 if a task failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["run", "collect"])
    parser.add_argument("names", nargs="*", metavar="TASK")
    parser.add_argument("--graph", default="experiments", help="the name of the YAML file (default: %(default)s)")
    parser.add_argument("--root", type=Path, default=ROOT, help="a checkout of the repository (default: this one)")
    parser.add_argument("--cores", type=int, default=1, help="number of cores of a task (default: %(default)s)")
    parser.add_argument("--planned", action="store_true", help="with the tasks that have no result yet")
    asked = parser.parse_args(words)
    try:
        results = opened(asked.graph, asked.root)
        if unknown := sorted(set(asked.names) - set(results.graph.tasks)):
            raise ValueError(f"no task is called {', '.join(unknown)}; there are {', '.join(results.graph.tasks)}")
        if asked.action == "collect":
            collect(results, asked.planned)
        for name in asked.names if asked.action == "run" else []:
            run(results, results.graph.tasks[name], asked.cores, asked.planned)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
