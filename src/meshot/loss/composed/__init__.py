"""Losses between surfaces, composed of an encoding and a loss of measures, each found by its name.

``ENCODINGS`` and ``LOSSES`` are the tables; :func:`surface_loss` composes a :class:`SurfaceLoss` from flat settings and
refuses one that neither part uses.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
