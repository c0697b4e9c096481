"""Small constructions that chapters teach with, and that the library does not need.

Points along a contour, fields that are not Lipschitz or not steady, the crossing of triangles under an exact flow, the
memory of a backward pass.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
