"""CortexODE: the same flows, which learn from squared Chamfer distances between sampled points.

Ma et al., *CortexODE: Learning Cortical Surface Reconstruction by Neural ODEs*, IEEE Transactions on Medical Imaging,
2022. Initial surface, network and schedule are those of the other systems here, so that the loss alone differs.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """CortexODE; the factor is the authors', and Adam hardly notices it."""

    name = "cortexode"
    loss = {"loss": "chamfer", "encoding": "samples", "factor": 1000.0}  # noqa: RUF012
