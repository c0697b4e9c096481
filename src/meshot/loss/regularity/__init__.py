"""Penalties of a single mesh: edge lengths, Laplacians, normals that disagree.

They measure how uneven a mesh is, without a target. All are differentiable in the vertices.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
