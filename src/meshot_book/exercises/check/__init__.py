"""The checkers of the exercises, by name: ``check.NAME(your_function)`` prints one line."""

from meshot_book.exercises import cortex, flows, measures, points, trials

EXERCISES = {
    name: checker
    for part in (points, measures, flows, cortex, trials)
    for name, checker in vars(part).items()
    if hasattr(checker, "exercise")
}
globals().update(EXERCISES)
