"""Distances that judge a surface: each with a unit, a definition and the floor of a perfect surface.

:func:`evaluate` gives all of them. They are computed with POT, GeomLoss, libigl and SciPy and never with the losses of
this package, so that an error in a loss cannot hide in the number that judges it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
