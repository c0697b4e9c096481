"""The checkers of the exercises, by name: ``check.NAME(your_function)`` prints one line and returns a record.

The edition for students has the file ``ANSWERS`` in place of the modules with the solutions: expected answers only.
"""

import dataclasses
import json
from pathlib import Path

import numpy as np
import torch

from meshot.files import write_whole
from meshot_book.exercises import given
from meshot_book.exercises.verdict import AnswerKey, checker

ANSWERS = Path(__file__).with_name("answers.json")


def _as_json(value: object) -> object:
    """What stands for arguments and answers in JSON: arrays with their type, tuples, and what ``given`` has by name."""
    if isinstance(value, torch.Tensor | np.ndarray):
        kind = "tensor" if isinstance(value, torch.Tensor) else "array"
        dtype = str(value.dtype).removeprefix("torch.")
        return {kind: value.reshape(-1).tolist(), "dtype": dtype, "shape": list(value.shape)}
    if isinstance(value, tuple | list):
        items = [_as_json(item) for item in value]
        return {"tuple": items} if isinstance(value, tuple) else items
    if dataclasses.is_dataclass(value):
        fields = {field.name: _as_json(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"given": type(value).__name__, "fields": fields}
    return {"given": value.__name__} if callable(value) else value


def _from_json(value: object) -> object:
    if isinstance(value, list):
        return [_from_json(item) for item in value]
    if not isinstance(value, dict):
        return value
    if "tuple" in value:
        return tuple(_from_json(value["tuple"]))
    if "tensor" in value:
        return torch.tensor(value["tensor"], dtype=getattr(torch, value["dtype"])).reshape(value["shape"])
    if "array" in value:
        return np.array(value["array"], dtype=value["dtype"]).reshape(value["shape"])
    found = getattr(given, value["given"])
    return found(**{name: _from_json(item) for name, item in value["fields"].items()}) if "fields" in value else found


def key_of(answers: dict) -> AnswerKey:
    """The answers of an exercise, as ``write_answers`` wrote them."""
    return AnswerKey(
        **{name: _from_json(value) for name, value in answers.items() if name != "cases"}
        | {"cases": {name: _from_json(arguments) for name, arguments in answers["cases"].items()}}
    )


if ANSWERS.is_file():
    # Arguments are handed over as copies, but whatever a function keeps lasts for one check: a key is made anew.
    EXERCISES = {
        name: checker(name, each["words"], each["stars"], lambda answers=each["key"]: key_of(answers))
        for name, each in json.loads(ANSWERS.read_text(encoding="utf-8")).items()
    }
else:
    from meshot_book.exercises import cortex, flows, measures, points, trials

    EXERCISES = {
        name: found
        for part in (points, measures, flows, cortex, trials)
        for name, found in vars(part).items()
        if hasattr(found, "exercise")
    }
globals().update(EXERCISES)


def write_answers(file: Path) -> None:
    """Write what takes the place of the solutions, for a package in which this file is ``ANSWERS``."""
    answers = {}
    for name, found in EXERCISES.items():
        key = found.exercise().key()
        answers[name] = {
            "words": found.__doc__,
            "stars": found.stars,
            "key": {
                "cases": {case: _as_json(arguments) for case, arguments in key.cases.items()},
                "right": _as_json(list(key.right)),
                "wrong": [_as_json((hint, list(its))) for hint, its in key.wrong],
                "properties": _as_json(key.properties),
                "way": _as_json(key.way),
            },
        }
    write_whole(file, json.dumps(answers))
