"""Synthetic subjects: folded cortex, structures, magnetic-resonance images of them.

From a seed to white and pial surfaces that are known exactly, and to a T1-like image. ``cohorts`` writes whole cohorts
and reads them; ``defects`` plants known errors in surfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
