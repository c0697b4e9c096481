"""Penalties of a single mesh: edge lengths, Laplacians, and inconsistent normals.

They measure how irregular a mesh is, without a target. All are differentiable with respect to the vertices.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
