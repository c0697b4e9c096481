"""Short names of the warnings about a reconstruction, for tables."""

from collections.abc import Iterable

from meshot.pipeline.quality_warnings import contrast_with
from meshot.volume import StandardScan, Volume

#: Name -> words that stand in the sentence of this warning and in no other.
WORDS = {
    "few_values": "different values; a T1 holds hundreds",
    "bright_volume": "the bright part of the scan has",
    "agreement": "the registered scan and the template agree poorly",
    "contrast": "inside the brain the scan differs from a T1",
    "gap": "of the template's brain lie in one piece where the scan is empty",
    "stretch": "the registration stretches one direction",
    "scale": "the registration scales the scan by",
    "mirrored": "the registration mirrors the scan",
    "surface_volume": "surface encloses",
    "voxels_given_up": "were given up to make it a ball",
    "crossing_faces": "surface crossed after the flow",
    "group_average": "is it a group average?",
    "long_echo_time": "is it a T2?",
    "unreadable_sidecar": "the sidecar is not used",
    "same_file_twice": "hold the same scan",
}
#: What has no name of its own.
OTHER = "other"
#: Correlation with the template inside its brain. The template has 1.00, also after registration, and .98 with blur and
#: noise of 2 %; the synthetic head in the repository has .50.
HIGHEST_CONTRAST = 0.97


def warning_names(found: Iterable[str]) -> list[str]:
    """The name of each warning, in order.

    Parameters
    ----------
    found : iterable of str
        Sentences, as in :class:`meshot.pipeline.Reconstruction`.
    """
    return [next((name for name, words in WORDS.items() if words in sentence), OTHER) for sentence in found]


def average_warnings(scan: StandardScan, template: Volume) -> list[str]:
    """Whether a scan is so like the template, an average of 152 heads, that it must be an average too.

    Parameters
    ----------
    scan : StandardScan
    template : Volume
    """
    contrast = contrast_with(scan.volume, template)
    if contrast < HIGHEST_CONTRAST:
        return []
    return [
        f"the scan is like the average of 152 heads (correlation {contrast:.2f} with the template; less than "
        f"{HIGHEST_CONTRAST} is usual): is it a group average? Then its surfaces are those of no person"
    ]
