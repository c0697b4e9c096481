"""Types for annotations. Those of arrays, such as ``Float[Tensor, "n d"]``, are checked by beartype under pytest."""

from typing import Literal, get_args

import numpy as np
from jaxtyping import Bool, Float, Int, Int64, Shaped
from torch import Tensor

Array = np.ndarray

#: What places scans on the standard grid: the registration of grey values alone, or the white matter after it.
Placement = Literal["grey values", "white matter"]
PLACEMENTS: tuple[Placement, ...] = get_args(Placement)

__all__ = ["PLACEMENTS", "Array", "Bool", "Float", "Int", "Int64", "Placement", "Shaped", "Tensor"]
