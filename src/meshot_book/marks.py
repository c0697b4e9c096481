"""Marks for a folder of handed-in notebooks: ``python -m meshot_book.marks FOLDER``.

A folder in it is a student, with notebooks and the record of ``meshot_book.exercises.report``; so is a notebook that
lies in it by itself, with a record of the same name. A record can be edited: the answers are run again, each in a
process of its own with a time limit. Of a notebook only the cells run that an answer needs. This is no sandbox: the
code of students runs with the rights of whoever calls this. The table of all exercises is ``FOLDER/marks.csv``.
"""

import argparse
import ast
import contextlib
import csv
import dataclasses
import io
import json
import multiprocessing
import os
import re
import signal
import symtable
import sys
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path

from meshot.files import printable_name, write_whole
from meshot_book.exercises import Record, read_report
from meshot_book.exercises.check import EXERCISES

SECONDS = 60.0
TABLE = "marks.csv"


@dataclasses.dataclass(frozen=True)
class Answer:
    """One exercise in one notebook: the cells that its answer needs, and the expression that is checked."""

    exercise: str
    cells: tuple[str, ...]
    expression: str


def found_answers(notebook: Path) -> list[Answer]:
    """The last check of every exercise in a notebook, in the order of the notebook.

    Raises
    ------
    ValueError
        If the file is no notebook.
    """
    try:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        codes = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"no notebook can be read ({type(error).__name__}: {error})") from error
    parsed = [found for code in codes if (found := _parsed(code)) is not None]
    answers: dict[str, Answer] = {}
    for number, (tree, *_) in enumerate(parsed):
        for place, statement in enumerate(tree.body):
            for call in (node for node in ast.walk(statement) if isinstance(node, ast.Call) and len(node.args) == 1):
                name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
                if name in EXERCISES and ast.unparse(call.func.value).endswith("check"):
                    before = _parsed(ast.unparse(ast.Module(tree.body[:place], [])))
                    expression = ast.unparse(call.args[0])
                    answers[name] = Answer(name, _needed([*parsed[:number], before], expression), expression)
    return list(answers.values())


def _parsed(code: str) -> tuple[ast.Module, set[str], set[str]] | None:
    """A cell, the global names that it defines, and those that it uses; None if it has an error of syntax."""
    for text in (code, re.sub(r"^(\s*)[%!].*$", r"\1pass", code, flags=re.M)):  # with and without magic commands
        with contextlib.suppress(SyntaxError, ValueError, MemoryError):
            return ast.parse(text), *_globals(text)
    return None


def _globals(code: str) -> tuple[set[str], set[str]]:
    made, used = set(), set()
    tables = [symtable.symtable(code, "cell", "exec")]
    while tables:
        table = tables.pop()
        tables += table.get_children()
        for symbol in table.get_symbols():
            at_top = table.get_type() == "module"
            if symbol.is_assigned() or symbol.is_imported():
                made |= {symbol.get_name()} if at_top or symbol.is_declared_global() else set()
            if symbol.is_referenced() and (at_top or symbol.is_global()):
                used.add(symbol.get_name())
    return made, used


def _needed(parsed: list, expression: str) -> tuple[str, ...]:
    """The cells on which an expression depends, in their order."""
    names, chosen = _globals(expression)[1], set()
    while more := {k for k, (_, made, _) in enumerate(parsed) if made & names} - chosen:
        chosen |= more
        names |= set().union(*(parsed[k][2] for k in more))
    return tuple(ast.unparse(parsed[k][0]) for k in sorted(chosen))


def rerun(answer: Answer, folder: Path, seconds: float = SECONDS) -> Record:
    """Run an answer in a process of its own and check it; what stops it is the hint of the record."""
    ours, theirs = _CONTEXT.Pipe()
    process = _CONTEXT.Process(target=_run, args=(answer, str(folder), theirs), daemon=True)
    process.start()
    theirs.close()
    try:
        ours.recv_bytes()  # it is there
        if not ours.poll(seconds):
            return _failed(answer, f"it took more than {seconds:g} s; the answer was stopped")
        return Record(**json.loads(ours.recv_bytes()))
    except (EOFError, OSError, ValueError, TypeError):
        process.join(1)
        return _failed(answer, f"its process ended before the answer was checked (status {process.exitcode})")
    finally:
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # with whatever it has started
        process.kill()
        process.join()
        ours.close()


def _failed(answer: Answer, why: str) -> Record:
    of = EXERCISES[answer.exercise].stars
    return Record(answer.exercise, 0, 0, 0, of, why)


def _run(answer: Answer, folder: str, channel: Connection) -> None:
    """In the process of an answer. What it prints is dropped."""
    if hasattr(os, "setsid"):
        os.setsid()
    silence = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silence, stream)
    sys.stdout = sys.stderr = io.StringIO()
    check = EXERCISES[answer.exercise]  # before any code of the student
    channel.send_bytes(b"")
    try:
        os.chdir(folder)
        names, raised = {"__name__": "__main__"}, None
        for code in answer.cells:
            try:
                exec(compile(code, "<cell>", "exec"), names)
            except Exception as error:  # as in Jupyter, what the cell defined before stays
                raised = raised or error
        try:
            found = eval(answer.expression, names)
        except NameError as error:
            raise (raised or error) from None
        record = check(found)
    except BaseException as error:
        said = str(error).strip().splitlines()
        why = f"a cell that it needs raised {type(error).__name__}{': ' + said[0][:100] if said else ''}"
        record = _failed(answer, why)
    channel.send_bytes(json.dumps(dataclasses.asdict(record)).encode())


#: Where there is fork, a process that has imported the libraries forks for each answer. No answer runs in it.
_CONTEXT = multiprocessing.get_context("forkserver" if hasattr(os, "fork") else "spawn")
if hasattr(os, "fork"):
    _CONTEXT.set_forkserver_preload(["meshot_book.exercises.check"])


def students(folder: Path) -> dict[str, tuple[list[Path], list[Path]]]:
    """The notebooks and the records of each student in a folder.

    Raises
    ------
    ValueError
        If there is no such folder, or no notebook in it.
    """
    found: dict[str, tuple[list[Path], list[Path]]] = {}
    files = sorted(folder.rglob("*")) if folder.is_dir() else []
    for file in files:
        inside = file.relative_to(folder)
        if any(part.startswith(".") for part in inside.parts) or file.suffix not in (".ipynb", ".json"):
            continue
        name = inside.parts[0] if len(inside.parts) > 1 else file.stem
        found.setdefault(name, ([], []))[file.suffix == ".json"].append(file)
    found = {name: both for name, both in found.items() if both[0]}
    if not found:
        came = "holds no notebooks" if folder.is_dir() else "is no folder"
        raise ValueError(f"{folder} {came}; name one with a folder of notebooks for each student")
    return found


def marked(folder: Path, seconds: float = SECONDS) -> tuple[list[dict], list[dict]]:
    """Rows for all students, and rows for all exercises; a line is printed for each file that failed."""
    totals, rows = [], []
    for student, (notebooks, reports) in students(folder).items():
        claimed, remarks, own = {}, [], {}
        for file in reports:
            try:
                claimed |= read_report(file)
            except ValueError as error:
                remarks.append(str(error).partition(" (")[0].replace(str(file), file.name))
                print(printable_name(str(error)))
        for notebook in notebooks:
            try:
                answers = found_answers(notebook)
            except (ValueError, RecursionError) as error:
                remarks.append(f"{notebook.name} failed")
                print(f"{printable_name(notebook)}: {error}")
                continue
            for answer in answers:
                record = rerun(answer, notebook.parent, seconds)
                if record.cases == 0:
                    print(f"{printable_name(notebook)}, {record.exercise}: {record.hint}")
                own[record.exercise] = (notebook, record)
        for name, (notebook, record) in own.items():
            told = claimed.get(name)
            rows.append(
                {"student": student, "notebook": notebook.name, **dataclasses.asdict(record)}
                | {"reported": told.points if told else ""}
            )
        differ = sorted(n for n, r in claimed.items() if r.points != (own[n][1].points if n in own else 0))
        if differ:
            remarks.append(f"the record differs in {', '.join(differ)}")
        records = [record for _, record in own.values()]
        totals.append(
            {"student": student, "points": sum(r.points for r in records), "of": sum(r.of for r in records)}
            | {"reported": sum(r.points for r in claimed.values()) if claimed else "", "remarks": "; ".join(remarks)}
        )
    return totals, rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Mark a folder from the command line; the exit status."""
    parser = argparse.ArgumentParser(
        "python -m meshot_book.marks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="the time limit of an answer (%(default)g)")
    options = parser.parse_args(arguments)
    try:
        if not options.seconds > 0:
            raise ValueError(f"{options.seconds:g} seconds are no time limit; give a positive number")
        totals, rows = marked(options.folder, options.seconds)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    table = io.StringIO()
    writer = csv.DictWriter(table, list(rows[0]) if rows else ["student"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(options.folder / TABLE, table.getvalue())
    width = max(len("student"), *(len(total["student"]) for total in totals))
    for row in ({name: name for name in totals[0]}, *totals):
        student, points, of, reported, remarks = map(str, row.values())
        print(f"{student:{width}}  {points:>6} {of:>3} {reported:>8}  {remarks}".rstrip())
    print(f"all exercises: {printable_name(options.folder / TABLE)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
