"""Run one task of a workflow, or say which results are out of date.

::

    python workflow/run_task.py why
    python workflow/run_task.py run ddot --cores 1
    python workflow/run_task.py stands study
    python workflow/run_task.py collect

``why`` prints the results that are out of date, with reasons. ``run`` runs the command of a task and writes its stamp;
this is what Snakemake calls. ``stands`` notes that a result, made by hand, stands for the present settings. ``collect``
moves the stamps of results into ``standing.json``.
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

from standing import Standing, locked
from tasks import Task, read_graph

from meshot.files import whole_file

ROOT = Path(__file__).resolve().parent.parent
STARTED = "started.txt"
#: Ends a process group when its input ends without a line.
GUARD = 'read line || kill -s TERM -- "-$0"'


def opened(graph: str, root: Path = ROOT) -> Standing:
    """A workflow of this folder in a checkout, by the name of its YAML file."""
    state = root / "build" / "workflow" / graph
    return Standing(read_graph(root / "workflow" / f"{graph}.yaml", root), root, state, _kept(graph, root, state))


def _kept(graph: str, root: Path, state: Path) -> Path:
    """Only the results of the experiments are in the repository."""
    return root / "workflow" / "standing.json" if graph == "experiments" else state / "standing.json"


def yes_or_no(name: str, value: object) -> bool:
    """The value of a setting of Snakemake, which is a truth value or a text.

    Raises
    ------
    ValueError
        If it is anything but yes, no, true or false, in letters of either case.
    """
    found = {"yes": True, "true": True, "no": False, "false": False}.get(str(value).lower())
    if found is None:
        raise ValueError(f"{name} is {value}; it is yes, no, true or false: --config {name}=yes")
    return found


def run(standing: Standing, task: Task, cores: int, planned: bool) -> None:
    """Run a task and write its stamp. Of two processes that run the same task, the second waits for the first.

    If this process is ended, by whatever signal, its command is terminated. The command holds the lock of the task,
    too: while it goes on, nobody starts it again.

    Raises
    ------
    ValueError
        If the command fails, leaves no result, or its settings change meanwhile.
    """
    stamp = standing.stamp(task, planned)
    with locked(stamp.parent) as lock:
        if stamp.is_file():
            return
        for other in stamp.parent.glob("*.json"):
            other.unlink()
        clear_other(standing, task, stamp)
        _call(task, cores, standing.root, lock.fileno())
        for start, end in task.copies:
            with whole_file(standing.root / end) as temporary:
                shutil.copyfile(standing.root / start, temporary)
        if gone := [path for path in (*task.writes, *task.makes) if not (standing.root / path).exists()]:
            raise ValueError(f"{task.name} ended without {', '.join(gone)}; correct its command, or its entry")
        now = Standing(standing.graph, standing.root, standing.state, standing.kept)
        if now.stamp(task, planned) != stamp:
            raise ValueError(f"the settings of {task.name} changed while it ran; start again")
        with whole_file(stamp) as temporary:
            temporary.write_text(json.dumps(now.inputs(task, planned)), encoding="utf-8")


def clear_other(standing: Standing, task: Task, stamp: Path) -> None:
    """Remove what an earlier start of the task with other settings has left."""
    started = stamp.parent / STARTED
    if started.is_file():
        other = started.read_text(encoding="utf-8") != stamp.stem
    else:
        other = task.name in standing.entries and any("missing" not in reason for reason in standing.reasons(task))
    for path in [standing.root / name for name in task.clears] if other else []:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    with whole_file(started) as temporary:
        temporary.write_text(stamp.stem, encoding="utf-8")


def _call(task: Task, cores: int, root: Path, lock: int) -> None:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), str(cores))
    tools = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    environment = os.environ | threads | {"PATH": tools}
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


def collect(standing: Standing, planned: bool) -> None:
    """Note for which settings the results stand that have been made, and remove their stamps."""
    ended = {name: standing.stamp(task, planned) for name, task in standing.graph.tasks.items() if task.writes}
    ended = {name: stamp for name, stamp in ended.items() if stamp.is_file()}
    noted = {name: stamp for name, stamp in ended.items() if not standing.graph.tasks[name].derived}
    standing.stand({name: json.loads(stamp.read_text(encoding="utf-8")) for name, stamp in noted.items()})
    for stamp in ended.values():
        stamp.unlink()


def stands(standing: Standing, names: list[str]) -> None:
    """Note that results stand for the present settings, without running anything.

    Raises
    ------
    ValueError
        If a file of a result is missing, or its record states other settings.
    """
    for name in names:
        task = standing.graph.tasks[name]
        if gone := [path for path in task.writes if not (standing.root / path).exists()]:
            raise ValueError(f"{name} has no {', '.join(gone)}; run it first")
        if task.record and standing.digest(task.reads[0]) != standing.digest(f"{task.record}#config"):
            raise ValueError(f"{task.record} was made with other settings than {task.reads[0]}; run {name} again")
    standing.stand({name: standing.inputs(standing.graph.tasks[name]) for name in names})


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["why", "run", "stands", "collect"])
    parser.add_argument("names", nargs="*", metavar="TASK")
    parser.add_argument("--graph", default="experiments", help="the name of the YAML file (default: %(default)s)")
    parser.add_argument("--root", type=Path, default=ROOT, help="a checkout of the repository (default: this one)")
    parser.add_argument("--cores", type=int, default=1, help="number of cores of a task (default: %(default)s)")
    parser.add_argument("--planned", action="store_true", help="with the tasks that have no result yet")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Do what is asked. Returns 1 if a task failed, or ``why`` found a result that is out of date."""
    asked = parsed(words)
    try:
        standing = opened(asked.graph, asked.root)
        if unknown := sorted(set(asked.names) - set(standing.graph.tasks)):
            raise ValueError(f"no task is called {', '.join(unknown)}; there are {', '.join(standing.graph.tasks)}")
        if asked.action == "run":
            for name in asked.names:
                run(standing, standing.graph.tasks[name], asked.cores, asked.planned)
        elif asked.action == "collect":
            collect(standing, asked.planned)
        elif asked.action == "stands":
            stands(standing, asked.names)
        else:
            stale = standing.stale(asked.planned)
            print("\n".join(f"{name}: {'; '.join(reasons)}" for name, reasons in stale.items()) or "nothing is stale")
            return int(bool(stale))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
