"""Template anatomy distributed with nilearn: the MNI152 average and the fsaverage5 surfaces.

Volumes and meshes are in MNI152 or MNI305 coordinates, in mm. Only this subpackage imports nilearn.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
