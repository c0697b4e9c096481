"""Losses between surfaces: an encoding combined with a loss of measures, both selected by name.

``ENCODINGS`` and ``LOSSES`` list the names. :func:`surface_loss` makes a :class:`SurfaceLoss` from a flat mapping of
settings, and raises an error for a setting that neither part uses.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
