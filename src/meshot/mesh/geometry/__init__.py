"""Areas, normals, edges, curvature and plane sections of meshes, differentiable where possible.

All are functions of a mesh or a contour. Lengths are in units of the vertices, areas in their square. Normals point
outwards if the faces are consistently oriented.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
