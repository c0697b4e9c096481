"""Triangle meshes and contours, with reading and writing, sampling, and triangulation of polygons.

:class:`Mesh` and :class:`Contour` are immutable and are validated when they are created. Areas, normals, curvature;
topology and self-intersections; analytic shapes; smoothing, repair and decimation. Lengths are in the units of the
vertices. Coordinates read from scans are scanner RAS in mm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
