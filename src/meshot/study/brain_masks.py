"""Brain masks from a data set of derivatives."""

from pathlib import Path

from meshot.study.visits import Visit, entities_of

#: Spaces that are the grid of the scan.
_OWN_SPACES = (None, "T1w", "orig")
_FREE = ("space", "desc", "sub", "ses")


def brain_mask_of(derivatives: Path, visit: Visit) -> Path:
    """The brain mask of a visit: a name such as ``sub-01_ses-02_desc-brain_mask.nii.gz``, on the grid of the scan.

    The mask may leave out entities of the scan, but may not contradict them. The one with the most entities counts.

    Parameters
    ----------
    derivatives : pathlib.Path
        The top folder of the derivatives.
    visit : Visit

    Raises
    ------
    ValueError
        If there is none, or two fit equally well.
    """
    scan = entities_of(visit.scans[0].name)
    folders = [derivatives.joinpath(*visit.parts, "anat"), derivatives / visit.parts[0] / "anat"]
    fitting = [
        path
        for folder in dict.fromkeys(folders)
        for path in sorted(folder.glob("*_mask.nii*"))
        if _fits(entities_of(path.name), scan)
    ]
    if not fitting:
        raise ValueError(
            f"{derivatives} has no brain mask for {visit.label}; {visit.label}_desc-brain_mask.nii.gz in "
            f"{folders[0].relative_to(derivatives)} is needed, on the grid of {visit.scans[0].name}"
        )
    most = max(_n_entities(path) for path in fitting)
    best = [path for path in fitting if _n_entities(path) == most]
    if len(best) > 1:
        raise ValueError(f"{best[0].name} and {best[1].name} fit {visit.label} equally well; remove one of the masks")
    return best[0]


def _fits(mask: dict[str, str], scan: dict[str, str]) -> bool:
    own = mask.get("desc") == "brain" and mask.get("space") in _OWN_SPACES and mask.get("sub") == scan.get("sub")
    return own and all(scan.get(key) == value for key, value in mask.items() if key not in _FREE) and (
        mask.get("ses") in (None, scan.get("ses"))
    )  # fmt: skip


def _n_entities(path: Path) -> int:
    return len([key for key in entities_of(path.name) if key not in ("space", "desc")])
