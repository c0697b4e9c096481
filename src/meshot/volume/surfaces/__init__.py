"""Between volumes and surfaces: voxelisation, signed distance, genus-0 correction, marching cubes.

A closed mesh becomes a mask or a distance on a grid; a mask becomes one piece without handles; a field becomes a mesh.
Signed distance is negative inside. Lengths are in mm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
