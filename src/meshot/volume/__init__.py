"""Volumes: an array with the affine that takes voxel indices to scanner RAS in mm.

Reading and writing, interpolation, the standard grid of the networks, registration to it, tissue shares. The room
``surfaces`` goes between volumes and meshes. Every change of space is one affine, in one function.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
