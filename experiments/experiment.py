"""One runner for all experiments: it reads the settings, does the tasks, resumes after a kill, and writes the results.

An experiment is a folder with ``config.yaml`` and ``run.py``, which ends with :func:`run`. Every ``run.py`` has
``--help``, ``--set KEY=VALUE`` for other settings, ``--only`` for one task and ``--list`` for all of them.
"""

import argparse
import ast
import copy
import hashlib
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

import torch
import yaml
from tqdm import tqdm

from meshot.files import naming_a_full_disk, whole_file
from meshot.provenance import write_results

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "workflow"))

from stale import code_of_script, note_written  # noqa: E402

#: An option of experiments that measure synthetic cohorts: ``config["made_in"]`` is the folder that holds them.
COHORTS = {
    "made_in": ("--cohorts", {"default": str(ROOT / "build" / "cohorts"), "help": "the folder that holds the cohorts"})
}


def run(
    script: str,
    tasks: Callable[[dict], Iterable],
    work: Callable[[object, dict], object],
    summarise: Callable[[list[dict], dict], dict],
    data: str | Callable[[dict], str],
    options: dict[str, tuple[str, dict]] | None = None,
    words: list[str] | None = None,
) -> None:
    """Do what the command line asks: the missing tasks, then ``results.json`` with its provenance and its digests.

    Parameters
    ----------
    script : str
        The ``__file__`` of ``run.py``.
    tasks : callable
        The tasks for a configuration, as JSON values.
    work : callable
        Does a task, with the configuration. What it finds is a JSON value.
    summarise : callable
        The results, from rows with ``task``, ``found`` and ``seconds``, and the configuration.
    data : str or callable
        The data used, or how the configuration says it.
    options : dict, optional
        Further options of the command: the name in the configuration, the flag, and arguments of argparse. A setting
        of ``config.yaml`` is replaced if the option is given.
    words : list of str, optional
        The command line. By default, that of the process.
    """
    here = Path(script).resolve().parent
    stated = yaml.safe_load((here / "config.yaml").read_text(encoding="utf-8"))
    options = options or {}
    parser = argparse.ArgumentParser(
        description=ast.get_docstring(ast.parse(Path(script).read_text(encoding="utf-8"))),
        epilog=f"Settings: {', '.join(stated)}. A stopped run goes on where it was.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", dest="changes",
        help="replace a setting of config.yaml by a value in YAML, such as seeds=[0] or grid.margin=4",
    )  # fmt: skip
    parser.add_argument("--only", metavar="TASK", help="do one task: its number, or a part of its text in --list")
    parser.add_argument("--list", action="store_true", help="print the tasks and their numbers, and do nothing")
    parser.add_argument("--early", action="store_true", help="write the results of the tasks that are finished")
    parser.add_argument(
        "-o", "--output", type=Path,
        help=f"where the results go (default: results.json here; with other settings build/experiments/{here.name})",
    )  # fmt: skip
    for name, (flag, settings) in options.items():
        parser.add_argument(flag, dest=name, **settings)
    words = sys.argv[1:] if words is None else words
    asked = parser.parse_args(words)
    given = {name: value for name in options if (value := getattr(asked, name)) is not None}
    try:
        config = changed(stated, asked.changes) | given
    except ValueError as error:
        parser.error(str(error))
    kept = {name: config[name] for name in stated}
    usual = here if kept == stated else ROOT / "build" / "experiments" / here.name
    output = asked.output or usual / "results.json"
    torch.set_num_threads(config.get("n_threads", 1))
    started, partial, todo = time.process_time(), output.with_name("partial.jsonl"), list(tasks(config))
    if asked.only is not None or asked.list:
        numbers = {str(number): task for number, task in enumerate(todo, 1)}
        todo = [task for number, task in numbers.items() if asked.only in (None, number)]
        todo = todo or [task for task in numbers.values() if asked.only in _key(task)]
        if not todo:
            parser.error(f"no task is or contains {asked.only}; --list prints the {len(numbers)} tasks")
    if asked.list:
        print("\n".join(f"{number} {_key(task)}" for number, task in numbers.items() if task in todo))
        return
    if asked.early:
        done = finished(partial, stamp(script, config))
        todo = [task for task in todo if _key(task) in done]
    rows = run_jobs(todo, lambda task: work(task, config), partial, script=script, config=config)
    if asked.only is not None:
        print("\n".join(json.dumps(row, ensure_ascii=False) for row in rows))
        return
    results = summarise(rows, config)
    seconds = max(sum(row["seconds"] for row in rows), time.process_time() - started)
    command = " ".join(["python", f"experiments/{here.name}/run.py", *(words if kept != stated else [])])
    write_results(output, results, kept, command, data(config) if callable(data) else data, seconds)
    note_written(output)
    if not asked.early:
        partial.unlink(missing_ok=True)


def changed(config: dict, changes: Iterable[str]) -> dict:
    """The configuration with other values, such as ``grid.margin=4``.

    Raises
    ------
    ValueError
        If there is no such setting, or the value is not YAML.
    """
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
    tasks: Iterable[object],
    work: Callable[[object], object],
    partial: Path,
    *,
    script: str | Path,
    config: object,
    clock: Callable[[], float] = time.process_time,
) -> list[dict]:
    """Rows with ``task``, ``found`` and ``seconds``, in order. What an earlier, stopped run found is read from a file.

    Its results are used if the task, the configuration and the code that the script reaches are the same. Other inputs,
    such as weights or scans, are not checked: put a digest of them into the task or the configuration. Results that do
    not match stay in the file, and are used again if configuration and code are changed back.

    Parameters
    ----------
    tasks : iterable
        Descriptions of the tasks, as JSON values. They identify the stored results.
    work : callable
        Maps a task to its result, a JSON value. New and stored results have the same form.
    partial : path
        The file of finished tasks, one per line. Its folder is created. Remove the file once the results are written.
    script : path
        The script whose code decides.
    config : JSON
        Every setting that the work depends on.
    clock : callable
        Returns seconds.

    Raises
    ------
    TypeError
        If a task, the configuration or a result cannot be written as JSON.
    """
    mark = stamp(script, config)
    done, others = finished(partial, mark), len(_read(partial))
    if len(done) < others:
        warnings.warn(
            f"{partial.name} holds {others - len(done)} tasks that another configuration or other code has done: "
            "they are not used",
            stacklevel=2,
        )
    partial.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for task in tqdm(list(tasks), desc=Path(script).resolve().parent.name, unit="task"):
        key = _key(task)
        if key not in done:
            started = clock()
            found = work(task)
            line = json.dumps({"task": task, "stamp": mark, "found": found, "seconds": clock() - started})
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
        with whole_file(partial) as temporary:
            temporary.write_text(whole, encoding="utf-8")
    return [json.loads(line) for line in whole.splitlines()]
