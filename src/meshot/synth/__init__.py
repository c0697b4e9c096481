"""Synthetic subjects: folded cortical surfaces, other brain structures, and simulated magnetic-resonance images.

From a seed to exactly known white and pial surfaces, and a T1-like image. :func:`make_cohort` writes whole cohorts,
and :func:`read_subject` reads one subject.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
