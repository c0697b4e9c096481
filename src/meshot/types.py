"""Array types used in annotations: ``Float[Tensor, "n d"]`` and friends, checked by beartype under pytest."""

import numpy as np
from jaxtyping import Bool, Float, Int, Int64
from torch import Tensor

Array = np.ndarray

__all__ = ["Array", "Bool", "Float", "Int", "Int64", "Tensor"]
