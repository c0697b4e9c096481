"""DDOT, the system of the paper: flows trained with sliced Wasserstein distances between oriented varifolds.

Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport for Cortical Surface Reconstruction*, ICLR
2024.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """DDOT. The paper states no length of the scaled normals; 1 mm is one interpretation."""

    name = "ddot"
    loss = {"loss": "sliced", "encoding": "varifold", "normal_scale": 1.0}  # noqa: RUF012
