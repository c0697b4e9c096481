"""Metrics that compare a predicted surface with a target, each with a unit, a definition and a floor.

:func:`evaluate` computes all of them. They use POT, GeomLoss, libigl and SciPy and share no code with the losses of
this package, so that an error in a loss cannot affect the metrics.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
