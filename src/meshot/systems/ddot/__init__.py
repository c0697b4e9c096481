"""DDOT, the paper's system: flows that learn from sliced Wasserstein distances between oriented varifolds.

Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport for Cortical Surface Reconstruction*, ICLR
2024.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """DDOT."""

    name = "ddot"
    loss = {"loss": "sliced", "encoding": "varifold"}  # noqa: RUF012
