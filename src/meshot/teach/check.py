"""The checkers of the exercises, by name: ``check.NAME(your_function)`` prints one line."""

from meshot.teach.descent_exercises import largest_rate, line_pull, nearest_pull

__all__ = ["largest_rate", "line_pull", "nearest_pull"]
