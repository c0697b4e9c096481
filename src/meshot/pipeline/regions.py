"""Numbers of a reconstruction by region of the cortex, in the form of FreeSurfer's ``aparc.stats`` and as a table.

Regions are those of :func:`meshot.anatomy.desikan_killiany`. A vertex of a person belongs to the region of the nearest
vertex of fsaverage5's surface, which :func:`meshot.pipeline.carry_template` brought there.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree

from meshot.anatomy import HEMISPHERES, Hemisphere, Parcellation, desikan_killiany
from meshot.mesh import (
    Mesh,
    face_areas,
    gaussian_curvatures,
    mean_curvatures,
    vertex_areas,
    vertex_normals,
    write_vertex_labels,
    write_vertex_values,
)
from meshot.metrics import corresponds, cortical_thickness, cortical_volumes
from meshot.pipeline.reconstruction import HemisphereSurface, Reconstruction
from meshot.types import Array, Float, Int64

#: The length of a unit normal beside positions in mm. On fsaverage5, middles of faces that are moved by a millimetre
#: get the region of one of their corners in 99.99 % with it, and in 99.5 % by their positions alone.
NORMAL_MM = 2.0
#: The columns of the table: what each is, and its unit.
COLUMNS = {
    "hemisphere": ("left or right", None),
    "region": ("The name of the region in the Desikan-Killiany atlas", None),
    "n_vertices": ("Number of vertices of the white surface", None),
    "area_mm2": ("Area of the white surface", "mm2"),
    "volume_mm3": ("Volume between the white and the pial surface", "mm3"),
    "thickness_mm": ("Mean thickness, weighted by area", "mm"),
    "thickness_sd_mm": ("Standard deviation of the thickness over the region", "mm"),
    "mean_curvature": ("Mean of the absolute mean curvature of the white surface, weighted by area", "1/mm"),
    "gaussian_curvature": ("Mean of the absolute Gaussian curvature, weighted by area", "1/mm2"),
    "folding_index": ("Integral of |k1| (|k1| - |k2|) / (4 pi), with the principal curvatures k1 and k2", None),
    "curvature_index": ("Integral of the positive Gaussian curvature / (4 pi)", None),
}


def vertex_regions(mesh: Mesh, carried: Mesh, atlas: Parcellation) -> Int64[Array, " V"]:
    """The region of every vertex of a surface: that of the nearest vertex of the carried template.

    Nearest is meant in position and normal, so that the other side of a thin gyrus is far.

    Parameters
    ----------
    mesh : Mesh
        The white surface of a person.
    carried : Mesh
        fsaverage5's surface in its place, in the same space.
    atlas : Parcellation

    Raises
    ------
    ValueError
        If the carried surface has not as many vertices as the atlas.
    """
    if len(carried.vertices) != len(atlas.labels):
        raise ValueError(
            f"the carried surface has {len(carried.vertices)} vertices, and {atlas.name} {len(atlas.labels)} labels: "
            "pass what carry_template returns for fsaverage5"
        )
    own, theirs = (_placed(each) for each in (mesh, carried))
    return atlas.labels[cKDTree(theirs).query(own)[1]]


def _placed(mesh: Mesh) -> Float[Array, "V 6"]:
    """Position and normal of every vertex."""
    mesh = mesh.with_vertices(mesh.vertices.detach()).to("cpu", torch.float64)
    return np.concatenate([mesh.vertices.numpy(), NORMAL_MM * vertex_normals(mesh).numpy()], axis=1)


def region_numbers(
    white: Mesh, labels: Int64[Array, " V"], atlas: Parcellation, pial: Mesh | None = None
) -> list[dict[str, float | str | int]]:
    """A row for every region of one hemisphere; without a pial surface, no thickness and no volume.

    Parameters
    ----------
    white : Mesh
    labels : array
        The region of every vertex.
    atlas : Parcellation
    pial : Mesh, optional
        With the faces of ``white``.

    Raises
    ------
    ValueError
        If the faces of ``pial`` are others.
    """
    white = white.with_vertices(white.vertices.detach().double())
    areas = vertex_areas(white).numpy()
    means, gaussians = (f(white).numpy() for f in (mean_curvatures, gaussian_curvatures))
    spread = np.sqrt(np.maximum(means**2 - gaussians, 0))
    first, second = means + spread, np.abs(means - spread)
    quarter = areas / (4 * math.pi)
    sums = {
        "folding_index": quarter * first * (first - second),
        "curvature_index": quarter * np.maximum(gaussians, 0),
    }
    averages = {"mean_curvature": means, "gaussian_curvature": np.abs(gaussians)}
    if pial is not None:
        thickness = averages["thickness_mm"] = cortical_thickness(white, pial)
        sums["volume_mm3"] = cortical_volumes(white, pial)
    rows = []
    for label, name in enumerate(atlas.names):
        here = labels == label
        area = float(areas[here].sum())
        if label == 0 or not area > 0:
            continue
        row: dict[str, float | str | int] = {"region": name, "n_vertices": int(here.sum()), "area_mm2": area}
        row |= {key: float(values[here].sum()) for key, values in sums.items()}
        row |= {key: float(values[here] @ areas[here]) / area for key, values in averages.items()}
        if pial is not None:
            away = (thickness[here] - row["thickness_mm"]) ** 2
            row["thickness_sd_mm"] = float(np.sqrt(away @ areas[here] / area))
        rows.append({key: row[key] for key in COLUMNS if key in row})
    return rows


def write_regions(
    folder: Path, found: Reconstruction, names: Mapping[str, str], subject: str = "scan"
) -> list[dict[str, float | str | int]]:
    """Write thickness; and if the template was carried, a table of regions, and labels and FreeSurfer's table by side.

    Thickness needs a pial surface whose vertices correspond to those of the white one. Returns the rows of the table.

    Parameters
    ----------
    folder : pathlib.Path
    found : Reconstruction
    names : mapping
        Paths in the folder, for ``table``, ``stats``, ``labels`` and ``thickness``, without the suffix for the first.
        ``{short}`` stands for lh and rh, ``{side}`` for L and R. Without a name nothing is written.
    subject : str
        What the tables call the subject.
    """
    rows = [row for side in HEMISPHERES for row in _write_side(folder, found.surfaces[side], side, names, subject)]
    if not rows:
        return []
    place = _made(folder / names["table"])
    columns = [key for key in COLUMNS if any(key in row for row in rows)]
    lines = ["\t".join(columns)] + ["\t".join(_text(row.get(key)) for key in columns) for row in rows]
    place.with_name(place.name + ".tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    about = {
        key: {"Description": COLUMNS[key][0]} | ({"Units": COLUMNS[key][1]} if COLUMNS[key][1] else {})
        for key in columns
    }
    text = json.dumps(about, indent=1, ensure_ascii=False)
    place.with_name(place.name + ".json").write_text(text + "\n", encoding="utf-8")
    return rows


def _made(path: Path) -> Path:
    """A path whose folder exists."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _text(value: float | str | int | None) -> str:
    return "n/a" if value is None else f"{value:.4f}" if isinstance(value, float) else str(value)


def _write_side(
    folder: Path, surface: HemisphereSurface, side: Hemisphere, names: Mapping[str, str], subject: str
) -> list[dict]:
    """The files of one hemisphere; returns its rows."""
    short = {"short": f"{side[0]}h", "side": side[0].upper()}
    paths = {key: folder / name.format(**short) for key, name in names.items() if key != "table"}
    pial = surface.pial if corresponds(surface.final, surface.pial) else None
    if "thickness" in paths and pial is not None:
        write_vertex_values(_made(paths["thickness"]), cortical_thickness(surface.final, pial))
    if surface.carried is None:
        return []
    atlas = desikan_killiany(side)
    labels = vertex_regions(surface.final, surface.carried.mesh, atlas)
    rows = region_numbers(surface.final, labels, atlas, pial)
    if "labels" in paths:
        write_vertex_labels(_made(paths["labels"]), labels, atlas.names, atlas.colours)
    if "stats" in paths:
        text = aparc_stats(rows, surface.final, pial, side, subject)
        _made(paths["stats"]).write_text(text, encoding="utf-8")
    return [{"hemisphere": side} | row for row in rows]


def aparc_stats(rows: list[dict], white: Mesh, pial: Mesh | None, side: Hemisphere, subject: str) -> str:
    """The text of FreeSurfer's ``lh.aparc.stats``, which its tools and other programs read.

    Thickness and volume are 0 where there is no pial surface, and a comment says so.
    """
    header = [
        "Table of FreeSurfer cortical parcellation anatomical statistics", "", "generating_program meshot",
        f"subjectname {subject}", f"hemi {side[0]}h", "AnnotationFile aparc.annot",
        f"Measure Cortex, NumVert, Number of Vertices, {len(white.vertices)}, unitless",
        f"Measure Cortex, WhiteSurfArea, White Surface Total Area, {float(face_areas(white).sum()):.2f}, mm^2",
    ]  # fmt: skip
    if pial is None:
        header.append("No pial surface was found: GrayVol, ThickAvg and ThickStd are 0, and not measured")
    else:
        means = cortical_thickness(white, pial)
        areas = vertex_areas(white).detach().cpu().numpy()
        mean = float(means @ areas) / float(areas.sum())
        header.append(f"Measure Cortex, MeanThickness, Mean Thickness, {mean:.5f}, mm")
    fields = (
        ("StructName", "Structure Name", "NA"), ("NumVert", "Number of Vertices", "unitless"),
        ("SurfArea", "Surface Area", "mm^2"), ("GrayVol", "Gray Matter Volume", "mm^3"),
        ("ThickAvg", "Average Thickness", "mm"), ("ThickStd", "Thickness StdDev", "mm"),
        ("MeanCurv", "Integrated Rectified Mean Curvature", "mm^-1"),
        ("GausCurv", "Integrated Rectified Gaussian Curvature", "mm^-2"), ("FoldInd", "Folding Index", "unitless"),
        ("CurvInd", "Intrinsic Curvature Index", "unitless"),
    )  # fmt: skip
    for number, (name, full, unit) in enumerate(fields, 1):
        header += [f"TableCol {number:2d} {key} {value}" for key, value in zip(
            ("ColHeader", "FieldName", "Units"), (name, full, unit), strict=True)]  # fmt: skip
    header += [f"NRows {len(rows)}", f"NTableCols {len(fields)}", "ColHeaders " + " ".join(name for name, *_ in fields)]
    lines = [f"# {line}".rstrip() for line in header]
    for row in rows:
        numbers = (row.get("volume_mm3", 0.0), row.get("thickness_mm", 0.0), row.get("thickness_sd_mm", 0.0))
        curved = (row["mean_curvature"], row["gaussian_curvature"], row["folding_index"], row["curvature_index"])
        lines.append(
            f"{row['region']:<40}{row['n_vertices']:5d}{row['area_mm2']:7.0f}{numbers[0]:7.0f}{numbers[1]:7.3f}"
            f"{numbers[2]:6.3f}{curved[0]:10.3f}{curved[1]:10.3f}{curved[2]:9.0f}{curved[3]:9.1f}"
        )
    return "\n".join(lines) + "\n"
