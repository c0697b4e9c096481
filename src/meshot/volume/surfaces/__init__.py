"""Conversion between volumes and surfaces: voxelisation, signed distance, genus-0 correction, marching cubes.

A closed mesh is converted to a mask or a distance on a grid, a mask to one component of genus 0, and a field to a mesh.
Signed distances are negative inside. Lengths are in mm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
