"""Operations that make a new mesh: smoothing, repair of self-intersections, subdivision, decimation.

Every function returns a new mesh and does not modify its argument. Each docstring says whether the faces stay the same.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
