"""Statistics of repeated measurements: intervals for means, differences of two arms, fitted slopes, and reliability.

All intervals are 95 % confidence intervals: Student's for means of a few seeds, those of F and χ² for
reliability, the percentile bootstrap otherwise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
