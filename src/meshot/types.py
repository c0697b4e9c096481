"""Array types for annotations, such as ``Float[Tensor, "n d"]``. Under pytest, beartype checks them."""

import numpy as np
from jaxtyping import Bool, Float, Int, Int64
from torch import Tensor

Array = np.ndarray

__all__ = ["Array", "Bool", "Float", "Int", "Int64", "Tensor"]
