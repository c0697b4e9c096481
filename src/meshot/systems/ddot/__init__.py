"""DDOT, the paper's system: flows that learn from sliced Wasserstein distances between oriented varifolds.

Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport for Cortical Surface Reconstruction*, ICLR
2024.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """DDOT; the paper gives no length of the normals, and a millimetre is one reading of it."""

    name = "ddot"
    loss = {"loss": "sliced", "encoding": "varifold", "normal_scale": 1.0}  # noqa: RUF012
