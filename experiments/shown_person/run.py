"""Make the small data of S1, one adult, that the book shows; ``make person`` fetches what is needed.

``slices.safetensors.gz`` has slices through every lobe, black outside the cerebrum, with the white surfaces that the
package and FreeSurfer find. ``surfaces.safetensors.gz`` has both surfaces of both sides with fewer faces, and for each
vertex the signed distance of the whole surface from the other one. ``results.json`` has areas and volumes, the
distribution of the signed distance, and how far the surfaces lie apart at places that were named by looking.

All files are derived from subject S1 of pycortex; ``LICENSE`` is its licence.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import scipy.ndimage
import scipy.spatial
import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh, face_areas, read_mesh, signed_volume, simplified, taubin_smoothing
from meshot.metrics import Surface
from meshot.model import network_digest
from meshot.pipeline import load_networks, reconstruct
from meshot.provenance import file_digest, rounded
from meshot.types import Array
from meshot.volume import Volume, cropped, enclosed_fractions, read_volume, voxel_sizes
from meshot_book.figures.cortex import cut_slice, write_slices
from meshot_book.notebook import write_meshes

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

#: The ends of the bins of signed distances, in mm.
EDGES_MM = np.linspace(-3, 3, 121)


def defaced(scan: Volume, pial: list[Mesh], beyond_mm: float) -> Volume:
    """The box around the pial surfaces, black where a voxel lies farther from their inside than a limit, in mm."""
    box = cropped(scan, torch.cat([mesh.vertices for mesh in pial]), int(np.ceil(beyond_mm / voxel_sizes(scan).min())))
    inside = np.max([enclosed_fractions(mesh, box) for mesh in pial], axis=0) > 0
    away = scipy.ndimage.distance_transform_edt(~inside, sampling=voxel_sizes(box))
    return box.with_data(np.where(away <= beyond_mm, box.data, 0).astype(np.float32))


def vertex_areas(mesh: Mesh) -> Array:
    """A third of the area of the faces around each vertex, in mm²."""
    found = np.zeros(len(mesh.vertices))
    np.add.at(found, mesh.faces.numpy().ravel(), np.repeat(face_areas(mesh).double().numpy() / 3, 3))
    return found


def described(mesh: Mesh, signed: Array, n_smoothing: int) -> dict:
    """Area, area after light smoothing, volume, and how the signed distance from the other surface is distributed."""
    areas = vertex_areas(mesh)
    order = np.argsort(signed)
    share = np.cumsum(areas[order]) / areas.sum()
    quantiles = {
        f"{level:g}": float(signed[order][np.searchsorted(share, level)]) for level in (0.05, 0.25, 0.5, 0.75, 0.95)
    }
    counts, _ = np.histogram(signed.clip(EDGES_MM[0], EDGES_MM[-1]), EDGES_MM, weights=areas)
    return {
        "area_cm2": float(areas.sum()) / 100,
        "smoothed_area_cm2": float(face_areas(taubin_smoothing(mesh, n_smoothing)).sum()) / 100,
        "volume_cm3": float(signed_volume(mesh)) / 1000,
        "signed_mm": {
            "mean": float(signed @ areas / areas.sum()), "least": float(signed.min()), "most": float(signed.max()),
            "quantiles": quantiles,
        },
        "share_beyond": {f"{mm:g}": float(areas[np.abs(signed) > mm].sum() / areas.sum()) for mm in (0.5, 1, 2)},
        "shares_of_area": (counts / areas.sum()).tolist(),
    }  # fmt: skip


def at_place(place: dict, meshes: list[Mesh], signed: list[Array], beyond_mm: float) -> dict:
    """Near a place: the area whose distance from the other surface is beyond a limit, and the largest distance."""
    area, farthest = 0.0, 0.0
    for mesh, values in zip(meshes, signed, strict=True):
        near = np.linalg.norm(mesh.vertices.numpy() - np.array(place["at"]), axis=1) <= place["radius_mm"]
        area += float(vertex_areas(mesh)[near & (np.abs(values) > beyond_mm)].sum())
        farthest = max([farthest, *values[near]], key=abs)
    return place | {"area_mm2": area, "farthest_mm": float(farthest)}


def given_up(made_side: object, to_standard: Array) -> dict:
    """What the repair of topology gave up of a side: the part of the mask, and its volume in the scanner."""
    mask, ball = made_side.mask, made_side.genus_zero_mask
    lost = int(mask.data.sum()) - int(ball.data.sum())
    voxel_mm3 = abs(np.linalg.det(mask.affine[:3, :3]) / np.linalg.det(to_standard[:3, :3]))
    return {"share": lost / int(mask.data.sum()), "cm3": lost * voxel_mm3 / 1000}


def work(task: dict, config: experiment.Config) -> dict:
    """Everything: the data go to ``config.place``, the numbers are returned."""
    folder = Path(config["folder"])
    scan, networks = read_volume(folder / "scan.nii.gz"), load_networks()
    made = reconstruct(scan, networks.segmentation, networks.system)
    found = [
        made.surfaces[side].final.with_vertices(made.surfaces[side].final.vertices.double()) for side in HEMISPHERES
    ]
    reference = [Surface(read_mesh(folder / f"{side[0]}h.white.gii")) for side in HEMISPHERES]
    signed = {
        "found": [other.signed_distances(mesh.vertices.numpy()) for mesh, other in zip(found, reference)],
        "reference": [Surface(mesh).signed_distances(other.vertices) for mesh, other in zip(found, reference)],
    }
    meshes = {"found": found, "reference": [surface.mesh for surface in reference]}
    brain = defaced(
        scan, [read_mesh(folder / f"{side[0]}h.pial.gii") for side in HEMISPHERES], config["black_beyond_mm"]
    )
    slices = [
        cut_slice(brain, plane, position, found, reference, config["tolerance_mm"])
        for plane, positions in config["slices"].items()
        for position in positions
    ]
    write_slices(config.place / "slices.safetensors.gz", slices)
    small, values = {}, {}
    for of, both in meshes.items():
        for side, mesh, own in zip(HEMISPHERES, both, signed[of]):
            name = f"{of}, {side}"
            small[name] = simplified(mesh, config["n_faces"])
            nearest = scipy.spatial.KDTree(mesh.vertices.numpy()).query(small[name].vertices.numpy())[1]
            values[name] = own[nearest]
    write_meshes(config.place / "surfaces.safetensors.gz", small, config["vertex_step_mm"], values)
    numbers = {
        side: {of: described(meshes[of][k], signed[of][k], config["n_smoothing"]) for of in meshes}
        | {
            "given_up": given_up(made.surfaces[side].segmented, made.scan.to_standard),
            "crossed_before_repair": made.surfaces[side].repaired.n_crossing / len(found[k].faces),
            "largest_repair_mm": made.surfaces[side].repaired.largest_move,
        }
        for k, side in enumerate(HEMISPHERES)
    }
    places = [
        at_place(place, meshes[place["of"]], signed[place["of"]], config["beyond_mm"]) for place in config["places"]
    ]
    return {
        "sides": rounded(numbers),
        "places": rounded(places),
        "warnings": [{"name": each.name, "text": each.text, "value": each.value} for each in made.warnings],
        "seconds": rounded({"clock": made.wall_seconds, "processor": made.cpu_seconds}),
    }


def inputs_of(config: dict) -> dict:
    """Digests of the files and of the networks."""
    networks, folder = load_networks(), Path(config["folder"])
    files = [*sorted(folder.glob("*.gii")), folder / "scan.nii.gz"]
    parts = {"segmentation": networks.segmentation} | {k: p.network for k, p in networks.system.parts.items()}
    return {
        "files": {file.name: file_digest(file) for file in files},
        "networks": {name: network_digest(each) for name, each in parts.items()},
    }


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The numbers; the files are moved beside the results, with the licence of the data."""
    for name in ("slices", "surfaces"):
        shutil.copy(config.place / f"{name}.safetensors.gz", config.output.with_name(f"{name}.safetensors.gz"))
    shutil.copy(Path(config["folder"]) / "LICENSE", config.output.with_name("LICENSE"))
    return {"inputs": inputs_of(config), "edges_mm": rounded(EDGES_MM.tolist())} | rows[0]["found"]


def depends(config: dict) -> dict:
    """The settings, and the digests of the files and of the networks."""
    return dict(config) | inputs_of(config)


if __name__ == "__main__":
    data = "subject S1 of pycortex (BSD-2), one adult"
    experiment.run(__file__, lambda _: [{"of": "package"}], work, results, data, depends=depends)
