"""Surfaces as GIfTI images: coordinates in scanner RAS, with the names by which Connectome Workbench knows a cortex."""

import nibabel
import numpy as np

from meshot.types import Array

_SCANNER = 1
#: What Connectome Workbench reads: https://www.humanconnectome.org/software/connectome-workbench
PRIMARY = ("CortexLeft", "CortexRight", "Cortex", "CortexRightAndLeft", "Cerebellum")
SECONDARY = ("GrayWhite", "MidThickness", "Pial")


def gifti_image(vertices: Array, faces: Array, structure: tuple[str, str] | None = None) -> nibabel.GiftiImage:
    """A closed surface in scanner RAS as a GIfTI image.

    Parameters
    ----------
    vertices, faces : array
        In mm; of scanner RAS.
    structure : two str, optional
        ``AnatomicalStructurePrimary`` and ``AnatomicalStructureSecondary``, for example CortexLeft and GrayWhite.

    Raises
    ------
    ValueError
        If Connectome Workbench does not know one of the names.
    """
    points, triangles = {}, {}
    if structure is not None:
        if len(structure) != 2 or structure[0] not in PRIMARY or structure[1] not in SECONDARY:
            raise ValueError(
                f"structure is {structure!r}; one of {', '.join(PRIMARY)} and one of {', '.join(SECONDARY)} are needed"
            )
        points = {
            "AnatomicalStructurePrimary": structure[0],
            "AnatomicalStructureSecondary": structure[1],
            "GeometricType": "Anatomical",
        }
        triangles = {"TopologicalType": "Closed"}
    system = nibabel.gifti.GiftiCoordSystem(_SCANNER, _SCANNER, np.eye(4))
    arrays = [
        nibabel.gifti.GiftiDataArray(
            vertices.astype(np.float32), intent="NIFTI_INTENT_POINTSET", coordsys=system, meta=points
        ),
        nibabel.gifti.GiftiDataArray(faces.astype(np.int32), intent="NIFTI_INTENT_TRIANGLE", meta=triangles),
    ]
    return nibabel.GiftiImage(darrays=arrays)
