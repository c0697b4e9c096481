"""The checkers of the exercises, by name: ``check.NAME(your_function)`` prints one line and returns a record.

The edition for students has the file ``ANSWERS`` in place of the modules with the solutions: expected answers only.
"""

import dataclasses
import pickle
from pathlib import Path

from meshot_book.exercises.verdict import checker

ANSWERS = Path(__file__).with_name("answers.pickle")

if ANSWERS.is_file():
    EXERCISES = {}
    for name, (words, stars, key) in pickle.loads(ANSWERS.read_bytes()).items():
        # Arguments are handed over as copies, but whatever a function keeps lasts for one check: a key is read anew.
        EXERCISES[name] = checker(name, words, stars, lambda key=key: pickle.loads(key))
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
        wrong = [(hint, list(its)) for hint, its in key.wrong]
        answers[name] = (found.__doc__, found.stars, pickle.dumps(dataclasses.replace(key, wrong=wrong)))
    file.write_bytes(pickle.dumps(answers))
