"""Analytic surfaces and contours: examples whose area, volume or distance is known.

Spheres, ellipsoids, cubes, a folded sphere; circles, polygons, stars and a letter. Chapters draw them, and tests
compare with their closed forms.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
