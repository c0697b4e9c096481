"""BIDS derivatives: ``sub-01/anat/sub-01_hemi-L_white.surf.gii`` with sidecars, and the files of the data set."""

import json
import os
from pathlib import Path

import meshot
from meshot.anatomy import HEMISPHERES, mni152_t1
from meshot.files import printable_name, whole_file
from meshot.mesh import write_mesh
from meshot.pipeline import Reconstruction
from meshot.pipeline.report import TEMPLATE, itk_transform, lta_transform, structure_of, white_matter_labels
from meshot.study.visits import Visit
from meshot.volume import Volume, write_volume

REPORT_FOLDER = Path("report")
VERSION = "1.10.0"
#: What the specification does not describe: pages, tables and logs of the study, transforms, and surfaces.
IGNORED = (
    "*.html", "subjects.*", "verdicts*.tsv", "logs/", "report", "*_xfm.*", "*.surf.gii", "*_white.json", "*_pial.json",
)  # fmt: skip
_LABELS = "index\tname\tabbreviation\n1\tLeft cerebral white matter\tlWM\n2\tRight cerebral white matter\trWM\n"


def folder_of(visit: Visit) -> Path:
    """For example ``sub-01/ses-02``."""
    return Path(*visit.parts)


def arrange(folder: Path, found: Reconstruction, scan: Volume, visit: Visit) -> None:
    """Write ``anat``."""
    anat = folder / "anat"
    anat.mkdir()
    facts = {"Sources": [_source(visit, path) for path in visit.scans]}
    for side in HEMISPHERES:
        surface, start = found.surfaces[side], f"{visit.prefix}_hemi-{side[0].upper()}"
        for kind, mesh in surface.meshes().items():
            name = f"{start}_{kind}" if kind in ("white", "pial") else f"{start}_desc-{kind}_white"
            write_mesh(anat / f"{name}.surf.gii", mesh, structure=structure_of(side, kind))
            _write_json(anat / f"{name}.json", facts | {"SpatialReference": "scanner RAS of the T1w image, in mm"})
    start = anat / f"{visit.prefix}_desc-whitematter_dseg"
    write_volume(start.with_name(f"{start.name}.nii.gz"), white_matter_labels(found, scan))
    said = {"Description": "White matter, 1 on the left and 2 on the right", "Manual": False}
    grid = {"SpatialReference": facts["Sources"][0]}
    _write_json(start.with_name(f"{start.name}.json"), facts | said | grid)
    start.with_name(f"{start.name}.tsv").write_text(_LABELS, encoding="utf-8")
    if len(visit.scans) > 1:
        write_volume(anat / f"{visit.prefix}_desc-average_T1w.nii.gz", scan)
        said = {"Description": "Average of registered runs, on the grid of the first"}
        said["SkullStripped"] = visit.mask is not None
        _write_json(anat / f"{visit.prefix}_desc-average_T1w.json", facts | said)
    transform = anat / f"{visit.prefix}_from-T1w_to-{TEMPLATE}_mode-image_xfm"
    transform.with_name(f"{transform.name}.txt").write_text(
        itk_transform(found.registered.to_standard), encoding="utf-8"
    )
    lta = lta_transform(found.registered.to_standard, scan, printable_name(visit.scans[0].name), mni152_t1())
    transform.with_name(f"{transform.name}.lta").write_text(lta, encoding="utf-8")


def finish(folder: Path, visit: Visit, report: dict) -> None:
    """Nothing is left to write."""


def begin(study: Path, dataset: Path | None) -> None:
    """Write the description of the derivatives, ``.bidsignore`` and a README, unless they are there.

    Parameters
    ----------
    study : pathlib.Path
    dataset : pathlib.Path or None
        The BIDS data set that the scans come from.
    """
    description = {
        "Name": "White surfaces by meshot"
        + ("" if dataset is None else f" of {printable_name(dataset.resolve().name)}"),
        "BIDSVersion": VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": [{"Name": "meshot", "Version": meshot.__version__}],
    }
    if dataset is not None:
        description["DatasetLinks"] = {"raw": printable_name(os.path.relpath(dataset, study))}
    for name, text in (
        ("dataset_description.json", json.dumps(description, indent=1, ensure_ascii=False) + "\n"),
        (".bidsignore", "\n".join(IGNORED) + "\n"),
        ("README.md", f"# {description['Name']}\n\nWritten by `meshot reconstruct`. Not for clinical use.\n"),
    ):
        if not (study / name).exists():
            with whole_file(study / name) as temporary:
                temporary.write_text(text, encoding="utf-8")


def _source(visit: Visit, path: Path) -> str:
    """A BIDS URI of a scan in the raw data set, or the name of a file from elsewhere."""
    there = path.parts[-len(visit.parts) - 2 : -1]
    return f"bids:raw:{'/'.join([*there, path.name])}" if there == (*visit.parts, "anat") else printable_name(path.name)


def _write_json(path: Path, content: dict) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
