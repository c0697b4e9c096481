"""Statistics of repetitions: what chance does to a mean, to a difference between two arms, and to a fitted slope.

Intervals hold 95 %: Student's for the mean of a few seeds, the percentile bootstrap for statistics of many repetitions.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
