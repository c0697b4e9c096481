"""Meshes made from meshes: smoothing, mending, subdivision, decimation.

Every function returns a new mesh and leaves the one that came as it was. Each says whether it keeps the faces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
