"""Statistics of repeated measurements: intervals for means, for differences of two arms, and for fitted slopes.

All intervals are 95 % confidence intervals: Student's for means of a few seeds, the percentile bootstrap otherwise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
