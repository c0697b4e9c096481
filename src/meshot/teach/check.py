"""The checkers of the exercises, by name: ``check.NAME(your_function)`` prints one line."""

from meshot.teach.descent_exercises import largest_rate, line_pull, nearest_pull
from meshot.teach.scan_exercises import handles, is_simple, surface_ras

__all__ = ["handles", "is_simple", "largest_rate", "line_pull", "nearest_pull", "surface_ras"]
