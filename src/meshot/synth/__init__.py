"""Synthetic subjects: folded cortical surfaces, other brain structures, and simulated magnetic-resonance images.

From a seed to exactly known white and pial surfaces, and a T1-like image. ``cohorts`` writes and reads whole cohorts;
``defects`` adds known errors to surfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
