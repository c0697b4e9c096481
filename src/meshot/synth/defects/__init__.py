"""Surfaces with planted errors of known kind and size.

Shifts, noise, holes, spikes, blurred folds, bridges and crossings of sulcal walls: what a metric is tried on.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
