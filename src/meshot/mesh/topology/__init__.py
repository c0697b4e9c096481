"""Topological invariants of a mesh, and its self-intersecting faces.

Euler number, components, boundary and non-manifold edges, and orientation depend on the faces only. Self-intersections
depend on the vertices too, and are computed by libigl.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
