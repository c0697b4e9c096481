"""Files of experiments that chapters read: from the checkout, or fetched from the repository and checked."""

import http.client
import os
import urllib.request
from pathlib import Path

from meshot import __version__
from meshot.provenance import file_digest

#: The environment variable with the address of the repository, such as ``https://github.com/OWNER/NAME``.
REPOSITORY = "MESHOT_REPOSITORY"
#: Every file that may be fetched, with its SHA-256. Written by ``make ledger`` from :func:`checksum_lines`.
CHECKSUMS = Path(__file__).with_name("experiments.sha256")
#: The files that chapters read, relative to the folder ``experiments``.
READ_BY_CHAPTERS = (
    "*/results.json",
    "*/before.json",
    "*/midway.json",
    "thickness/first.json",
    "thickness/second.json",
    "thickness/*_pial.json",
    "warnings/*/results.json",
    "ddot/*/results.json",
    "person/robustness.json",
    "*/*.safetensors",
    "*/*.safetensors.gz",
    "comparison/pairs.csv",
    "comparison/rates.json",
    "comparison/subjects.csv",
    "comparison/weights/adni_like_left_*_steps_0/left_white.json",
    "ddot/descent_directions.json",
    "ddot/weights/*_0.log.jsonl",
    "ddot/weights/oasis_like_left_*_0.safetensors",
    "deforming/meshes.py",
    "fsaverage5_flow/stored.py",
    "fsaverage5_flow/surfaces.py",
    "paper_table/paper.yaml",
    "segmentation/weights.json",
)
_PACKAGE = Path(__file__).resolve().parents[3]  # of a checkout, if the package is in one
_SECONDS = 60


def experiment_folder(name: str) -> Path:
    """The folder of an experiment, with everything that chapters read of it.

    In a checkout of the repository, and in an edition for a course, this is ``experiments/NAME``. Elsewhere, as for a
    chapter that was downloaded alone, the files are fetched from the repository into a cache and compared with the
    checksums in the package. The environment variable ``MESHOT_REPOSITORY`` holds the address of the repository.

    Parameters
    ----------
    name : str
        An experiment, such as ``"blur"``.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    ValueError
        If there is no such experiment, or a file is neither on this machine nor can be fetched.
    """
    lines = CHECKSUMS.read_text(encoding="utf-8").splitlines()
    digests = {file: digest for digest, file in (line.split("  ", 1) for line in lines)}
    known = sorted({file.partition("/")[0] for file in digests})
    if name not in known:
        raise ValueError(f"there is no experiment {name!r}; name one of {', '.join(known)}")
    files = [file for file in digests if file.startswith(f"{name}/")]
    for parent in (Path.cwd(), *Path.cwd().parents, _PACKAGE):
        folder = parent / "experiments"
        checkout = (parent / "src" / "meshot_book").is_dir() and (folder / name).is_dir()
        if checkout or all((folder / file).is_file() for file in files):
            return folder / name
    # In the user's cache. What is not there, whole and of this version, is fetched: the repository is asked for the
    # version of the package, and then for its branch main.
    import pooch  # it takes half a second, and is not needed in a checkout

    pooch.get_logger().setLevel("WARNING")
    repository = os.environ.get(REPOSITORY, "").rstrip("/")
    cache = pooch.os_cache("meshot") / f"experiments-{__version__}"
    addresses = [f"{repository}/raw/{version}/experiments/" for version in (f"v{__version__}", "main")]
    sources = [pooch.create(cache, address, registry=digests) for address in addresses]
    for file in files:
        troubles = []
        for source in sources:
            try:
                source.fetch(file, downloader=_download)
                break
            except (OSError, ValueError, http.client.HTTPException) as error:
                troubles.append(f"{source.get_url(file)}: {error}")
        else:
            if not repository:
                raise ValueError(
                    f"experiments/{file} is not on this machine, and no repository is named to fetch it from. Set the "
                    f"environment variable {REPOSITORY} to the address of the repository, such as "
                    f"https://github.com/OWNER/NAME, before this cell (%env {REPOSITORY}=...), or clone the "
                    "repository and open the chapter in its folder notebooks"
                )
            raise ValueError(
                f"experiments/{file} could not be fetched ({'; '.join(troubles)}). Check the address in {REPOSITORY} "
                "and the connection, or clone the repository and open the chapter in its folder notebooks"
            )
    return cache / name


def checksum_lines(folder: Path) -> str:
    """The checksums of the files that chapters read, as ``sha256sum`` writes them, for a folder of experiments."""
    files = sorted({file for pattern in READ_BY_CHAPTERS for file in folder.glob(pattern)})
    return "".join(f"{file_digest(file)}  {file.relative_to(folder).as_posix()}\n" for file in files)


def _download(address: str, place: str, _: object) -> None:
    """Unlike pooch's own downloaders, this one also reads addresses of files."""
    with urllib.request.urlopen(address, timeout=_SECONDS) as answer:
        Path(place).write_bytes(answer.read())
