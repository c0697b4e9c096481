"""Areas, normals, edges, curvature and plane sections of meshes, differentiable where it makes sense.

All are plain functions of a mesh or a contour. A length is in units of the vertices, an area in their square. Normals
point outward where faces are consistently oriented.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
