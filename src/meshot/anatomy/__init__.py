"""Template anatomy that comes with nilearn: the MNI152 average and the surfaces of fsaverage5.

Volumes and meshes are in the millimetres of MNI152. This is the only room that imports nilearn.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
