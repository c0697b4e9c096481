"""Networks: the segmentation U-Net and the deformation network, their weights as safetensors.

Networks map tensors to tensors and know no files except those of their weights, which carry a record of the training.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
