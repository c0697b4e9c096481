"""One runner for all experiments: it reads the settings, does the tasks, resumes after a kill, and writes the results.

An experiment is a folder with ``config.yaml`` and ``run.py``, which ends with :func:`run`. Every ``run.py`` has
``--help``, ``--set KEY=VALUE`` for other settings, ``--only`` for one task and ``--list`` for all of them.
"""

import argparse
import ast
import copy
import hashlib
import json
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

import torch
import yaml
from tqdm import tqdm

from meshot.files import naming_a_full_disk, write_whole
from meshot.provenance import write_results

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "workflow"))

from stale import code_of_script, note_written  # noqa: E402

#: An option of experiments that measure synthetic cohorts: ``config["made_in"]`` is the folder that holds them.
COHORTS = {
    "made_in": ("--cohorts", {"default": str(ROOT / "build" / "cohorts"), "help": "the folder that holds the cohorts"})
}


class Config(dict):
    """Settings that can be an argument of a cached function."""

    file: Path  # of the settings
    output: Path  # of the results; further files stand beside it
    place: Path  # for the states of the tasks with these settings and this code; removed once the results are written
    __hash__ = object.__hash__  # type: ignore[assignment]


def run(
    script: str,
    tasks: Callable[[Config], Iterable],
    work: Callable[[object, Config], object],
    summarise: Callable[[list[dict], Config], dict],
    data: str | Callable[[Config], str],
    options: dict[str, tuple[str, dict]] | None = None,
    depends: Callable[[Config], object] = dict,
    words: list[str] | None = None,
) -> Config | None:
    """Do what the command line asks: the missing tasks, then ``results.json`` with its provenance and its digests.

    Returns the configuration if the results were written.

    Parameters
    ----------
    script : str
        The ``__file__`` of ``run.py``.
    tasks : callable
        The tasks for a configuration, as JSON values.
    work : callable
        Does a task, with the configuration. What it finds is a JSON value.
    summarise : callable
        The results, from rows with ``task``, ``found`` and ``seconds``, and the configuration. If they list something
        under ``missing``, the finished tasks are kept for the next run.
    data : str or callable
        The data used, or how the configuration says it.
    options : dict, optional
        Further options of the command: the name in the configuration, the flag, and arguments of argparse. A setting
        of ``config.yaml`` is replaced if the option is given.
    depends : callable, optional
        What a finished task depends on beside the code. By default, the whole configuration.
    words : list of str, optional
        The command line. By default, that of the process.
    """
    here = Path(script).resolve().parent
    parser, options = _parser(Path(script), options or {}), options or {}
    asked = parser.parse_args(words := sys.argv[1:] if words is None else words)
    stated = yaml.safe_load(asked.config.read_text(encoding="utf-8"))
    given = {name: value for name in options if (value := getattr(asked, name)) is not None}
    try:
        config = Config(changed(stated, asked.changes) | given)
    except ValueError as error:
        parser.error(str(error))
    kept = {name: config[name] for name in stated}
    usual = asked.config == here / "config.yaml" and kept == stated
    folder = here if usual else ROOT / "build" / "experiments" / here.name
    config.file = asked.config
    config.output = asked.output or folder / "results.json"
    torch.set_num_threads(config.get("n_threads", 1))
    started, partial, todo = time.process_time(), config.output.with_name("partial.jsonl"), list(tasks(config))
    if asked.only is not None or asked.list:
        numbers = {str(number): task for number, task in enumerate(todo, 1)}
        todo = [task for number, task in numbers.items() if asked.only in (None, number)]
        if asked.only is not None:
            todo = todo or [task for task in numbers.values() if asked.only in _key(task)]
            if not todo:
                parser.error(f"no task is or contains {asked.only}; --list prints the {len(numbers)} tasks")
    if asked.list:
        lines = [f"{number} {_key(task)}" for number, task in numbers.items() if task in todo]
        print("\n".join(lines or ["there are no tasks: the results are computed at once"]))
        return None
    mark = stamp(script, depends(config))
    config.place = config.output.with_name("partial") / mark
    if asked.early:
        done = finished(partial, mark)
        todo = [task for task in todo if _key(task) in done]
    config.place.mkdir(parents=True, exist_ok=True)
    rows = run_jobs(todo, lambda task: work(task, config), partial, mark, here.name)
    if asked.only is not None:
        print("\n".join(json.dumps(row, ensure_ascii=False) for row in rows))
        return None
    results = summarise(rows, config)
    seconds = max(sum(row["seconds"] for row in rows), time.process_time() - started)
    command = " ".join(["python", f"experiments/{here.name}/run.py", *([] if usual else words)])
    write_results(config.output, results, kept, command, data(config) if callable(data) else data, seconds)
    note_written(config.output)
    if not asked.early and not results.get("missing"):
        partial.unlink(missing_ok=True)
        shutil.rmtree(config.place.parent)
    return config


def _parser(script: Path, options: dict[str, tuple[str, dict]]) -> argparse.ArgumentParser:
    """The command line of an experiment."""
    usual = script.resolve().parent / "config.yaml"
    settings = ", ".join(yaml.safe_load(usual.read_text(encoding="utf-8")))
    parser = argparse.ArgumentParser(
        description=ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))),
        epilog=f"Settings: {settings}. A stopped run goes on where it was.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--config", type=Path, default=usual, help="other settings than those of config.yaml here")
    add("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", dest="changes",
        help="replace settings by values in YAML, such as seeds=[0] or grid.margin=4")  # fmt: skip
    add("--only", metavar="TASK", help="do one task: its number, or the tasks with this text in --list")
    add("--list", action="store_true", help="print the tasks and their numbers, and do nothing")
    add("--early", action="store_true", help="write the results of the tasks that are finished")
    add("-o", "--output", type=Path, help="where the results go (default: results.json here; with other settings "
        f"build/experiments/{usual.parent.name})")  # fmt: skip
    for name, (flag, more) in options.items():
        add(flag, **({"dest": name} if flag.startswith("-") else {}) | more)
    return parser


def changed(config: dict, changes: Iterable[str]) -> dict:
    """The configuration with other values, such as ``grid.margin=4``."""
    config = copy.deepcopy(config)
    for change in changes:
        name, equals, value = change.partition("=")
        *place, last = name.split(".")
        inner = config
        for key in place:
            inner = inner.get(key, {}) if isinstance(inner, dict) else {}
        if not equals or not isinstance(inner, dict) or last not in inner:
            raise ValueError(f"there is no setting {change}; write KEY=VALUE with one of {', '.join(inner or config)}")
        try:
            inner[last] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ValueError(f"{change} is not YAML ({error}); write KEY=VALUE, such as seeds=[0]") from error
    return config


def run_jobs(
    tasks: Iterable[object], work: Callable[[object], object], partial: Path, mark: str, name: str
) -> list[dict]:
    """Rows with ``task``, ``found`` and ``seconds``, in order. What an earlier, stopped run found is read from a file.

    Other inputs than settings and code, such as weights or scans, are not checked: put a digest of them into the task.
    Results with another mark stay in the file, and are used again if configuration and code are changed back.

    ``partial`` is the file of finished tasks, one per line; remove it once the results are written. ``mark`` is what
    the results depend on: see :func:`stamp`. ``name`` is the description of the progress bar.
    """
    done, others = finished(partial, mark), len(_read(partial))
    if len(done) < others:
        warnings.warn(
            f"{partial.name} holds {others - len(done)} tasks that another configuration or other code has done: "
            "they are not used",
            stacklevel=2,
        )
    partial.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for task in tqdm(list(tasks), desc=name, unit="task"):
        key = _key(task)
        if key not in done:
            started = time.process_time()
            found = work(task)
            line = json.dumps({"task": task, "stamp": mark, "found": found, "seconds": time.process_time() - started})
            with naming_a_full_disk(partial), partial.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
            done[key] = json.loads(line)
        rows.append({"task": task, "found": done[key]["found"], "seconds": done[key]["seconds"]})
    return rows


def finished(partial: Path, mark: str) -> dict[str, dict]:
    """The lines of finished tasks with this stamp, by the text of the task."""
    return {_key(line["task"]): line for line in _read(partial) if line["stamp"] == mark}


def stamp(script: str | Path, config: object) -> str:
    """Sixteen hexadecimal digits that depend on the settings and on the code that the script reaches."""
    return hashlib.sha256(f"{_key(config)} {code_of_script(Path(script))}".encode()).hexdigest()[:16]


def _key(task: object) -> str:
    return json.dumps(task, sort_keys=True)


def _read(partial: Path) -> list[dict]:
    """The finished tasks. An incomplete last line, left by a killed run, is dropped and removed from the file."""
    if not partial.exists():
        return []
    text = partial.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        write_whole(partial, whole)
    return [json.loads(line) for line in whole.splitlines()]
