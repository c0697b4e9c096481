"""Triangle meshes and contours: the data that everything else works on.

:class:`Mesh` and :class:`Contour` are frozen and are validated once, when they are made. Here are also reading and
writing, sampling, and polygons cut into triangles. Smaller rooms: ``geometry`` (areas, normals, curvature),
``topology`` (counts, crossing faces), ``shapes`` (analytic examples), ``editing`` (smoothing, mending, decimation).
Lengths are in the units of the vertices; the space is scanner RAS in mm where a file says so.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
