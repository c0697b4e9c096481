"""Counts that say what kind of surface a mesh is, and the faces that cross each other.

Euler number, components, boundary and non-manifold edges, orientation: integers, which depend on the faces only.
Self-intersection depends on the vertices too, and comes from libigl.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
