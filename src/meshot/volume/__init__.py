"""Volumes: 3D arrays with an affine from voxel indices to scanner RAS in mm.

Reading and writing, interpolation, registration to the standard grid of the networks, tissue probabilities. Between
volumes and meshes: :func:`signed_distance`, :func:`isosurface`. All changes of space use one function for affine maps.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
