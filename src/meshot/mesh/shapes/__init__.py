"""Example surfaces and contours with known area, volume or distance.

Spheres, ellipsoids, cubes, a folded sphere; circles, polygons, stars and the letter E. The book uses them as examples,
and the tests compare results with their closed forms.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
