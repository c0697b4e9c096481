"""CortexODE: flows trained with squared Chamfer distances between sampled points.

Ma et al., *CortexODE: Learning Cortical Surface Reconstruction by Neural ODEs*, IEEE Transactions on Medical Imaging,
2022. Initial surface, network and schedule are those of the other systems here. Only the loss differs.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """CortexODE. The factor of the loss is that of the authors; it has almost no effect with Adam."""

    name = "cortexode"
    loss = {"loss": "chamfer", "encoding": "samples", "factor": 1000.0}  # noqa: RUF012
