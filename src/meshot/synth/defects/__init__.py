"""Surfaces with added errors of known kind and size, to test metrics.

Shifts, noise, holes, spikes, smoothed folds, and bridges and intersections between sulcal walls.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
