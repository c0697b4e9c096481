"""Name, unit and exact definition of every metric."""

from typing import NamedTuple


class Row(NamedTuple):
    """Name, unit and definition of a metric."""

    name: str
    unit: str
    definition: str


ROWS = {
    "emd": Row(
        "earth mover's distance",
        "mm",
        "Exact W2 (p = 2, root taken): the root of the least mean squared Euclidean distance over all pairings of "
        "{n_emd_points} points of one surface with as many of the other, drawn uniformly by area; no blur, hence "
        "nothing to debias.",
    ),
    "swd": Row(
        "sliced Wasserstein distance",
        "mm",
        "SW2 (p = 2, root taken): the root of the mean over {n_directions} even directions of the squared W2 between "
        "the projections of {n_points} points of each surface, drawn uniformly by area.",
    ),
    "assd": Row(
        "average symmetric surface distance",
        "mm",
        "The mean distance from {n_points} points of each surface to the nearest point on the faces of the other "
        "(point to face, not to a sampled point or a vertex), averaged over the two sides.",
    ),
    "hausdorff": Row(
        "Hausdorff distance at 90 %",
        "mm",
        "The 90 % quantile of the distances from {n_points} points of one surface to the faces of the other; the "
        "larger of the two sides, as DeepCSR and CortexODE report it (the two are not pooled).",
    ),
    "normals": Row(
        "Chamfer normals, absolute",
        "",
        "The mean absolute cosine between the normal at {n_points} points of each surface and the normal of the "
        "nearest face of the other, averaged over the two sides; normals of faces, not interpolated; 1 is best.",
    ),
    "signed_normals": Row(
        "Chamfer normals, signed",
        "",
        "The same without the absolute value: -1 for a surface turned inside out.",
    ),
    "intersecting_faces": Row(
        "self-intersecting faces",
        "faces",
        "Faces of the predicted mesh that meet another of its faces beyond a shared edge or corner, once each; the "
        "floor is the target's own count.",
    ),
    "intersecting_share": Row(
        "self-intersecting share",
        "%",
        "Self-intersecting faces in per cent of all faces of the predicted mesh; the floor is the target's own.",
    ),
    "euler_number": Row(
        "Euler number",
        "",
        "Vertices - edges + faces of the predicted mesh, 2 for a sphere; the floor is the target's own.",
    ),
    "area": Row("area", "mm²", "Total area of the faces of the predicted mesh; the floor is the target's own."),
    "volume": Row(
        "volume",
        "mm³",
        "Volume that the predicted mesh encloses, positive with outward normals; the floor is the target's own.",
    ),
    "edge_variation": Row(
        "edge length variation",
        "",
        "Standard deviation over mean of the edge lengths of the predicted mesh; the floor is the target's own.",
    ),
    "area_variation": Row(
        "face area variation",
        "",
        "Standard deviation over mean of the face areas of the predicted mesh; the floor is the target's own.",
    ),
    "smallest_angle": Row(
        "smallest angle",
        "degrees",
        "The smallest angle of each face of the predicted mesh, averaged over its faces (60 if all are equilateral); "
        "the floor is the target's own.",
    ),
}
#: The definition of the EMD if it is computed by Sinkhorn's algorithm.
BLURRED_EMD = (
    "Root of the debiased Sinkhorn divergence with squared Euclidean cost (p = 2; twice what GeomLoss returns) and a "
    "blur of {emd_blur} mm between {n_emd_points} points of each surface, drawn uniformly by area; scaling 0.95."
)
