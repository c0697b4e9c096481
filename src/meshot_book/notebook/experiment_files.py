"""Files of experiments that chapters read: from the checkout, or fetched from the repository and checked."""

import hashlib
import http.client
import os
import urllib.request
from pathlib import Path

from meshot import __version__
from meshot.files import whole_file
from meshot.provenance import file_digest

#: The environment variable with the address of the repository, such as ``https://github.com/OWNER/NAME``.
REPOSITORY = "MESHOT_REPOSITORY"
#: Every file that may be fetched, with its SHA-256. Written by ``make ledger`` from :func:`checksum_lines`.
CHECKSUMS = Path(__file__).with_name("experiments.sha256")
#: The files that chapters read, relative to the folder ``experiments``.
READ_BY_CHAPTERS = (
    "*/results.json",
    "ddot/*/results.json",
    "person/robustness.json",
    "*/*.safetensors",
    "*/*.safetensors.gz",
    "comparison/subjects.csv",
    "ddot/descent_directions.json",
    "ddot/weights/*_0.log.jsonl",
    "ddot/weights/oasis_like_left_*_0.safetensors",
    "deforming/meshes.py",
    "fsaverage5_flow/stored.py",
    "fsaverage5_flow/surfaces.py",
    "paper_table/paper.yaml",
)
_PACKAGE = Path(__file__).resolve().parents[3]  # of a checkout, if the package is in one
_SECONDS = 60


def experiment_folder(name: str) -> Path:
    """The folder of an experiment, with everything that chapters read of it.

    In a checkout of the repository this is ``experiments/NAME``. Elsewhere, as for a chapter that was downloaded
    alone, the files are fetched from the repository into a cache and compared with the checksums in the package. The
    environment variable ``MESHOT_REPOSITORY`` holds the address of the repository.

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
    digests = _checksums()
    known = sorted({file.partition("/")[0] for file in digests})
    if name not in known:
        raise ValueError(f"there is no experiment {name!r}; name one of {', '.join(known)}")
    for parent in (Path.cwd(), *Path.cwd().parents, _PACKAGE):
        if (parent / "src" / "meshot_book").is_dir() and (parent / "experiments" / name).is_dir():
            return parent / "experiments" / name
    cache = _cache_folder()
    for file, digest in digests.items():
        if file.startswith(f"{name}/"):
            _provide(cache / file, file, digest)
    return cache / name


def checksum_lines(folder: Path) -> str:
    """The checksums of the files that chapters read, as ``sha256sum`` writes them, for a folder of experiments."""
    files = sorted({file for pattern in READ_BY_CHAPTERS for file in folder.glob(pattern)})
    return "".join(f"{file_digest(file)}  {file.relative_to(folder).as_posix()}\n" for file in files)


def _checksums() -> dict[str, str]:
    """The SHA-256 of every file, by its path relative to the folder ``experiments``."""
    lines = CHECKSUMS.read_text(encoding="utf-8").splitlines()
    return {file: digest for digest, file in (line.split("  ", 1) for line in lines)}


def _cache_folder() -> Path:
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "meshot" / f"experiments-{__version__}"


def _provide(path: Path, file: str, digest: str) -> None:
    """Fetch a file into the cache unless it is there, whole and of this version."""
    if path.is_file() and file_digest(path) == digest:
        return
    content = _fetched(file, digest)
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def _fetched(file: str, digest: str) -> bytes:
    """The content of a file in the repository at the version of the package, or on the branch ``main``."""
    repository = os.environ.get(REPOSITORY, "").rstrip("/")
    if not repository:
        raise ValueError(
            f"experiments/{file} is not on this machine, and no repository is named to fetch it from. Set the "
            f"environment variable {REPOSITORY} to the address of the repository, such as "
            f"https://github.com/OWNER/NAME, before this cell (%env {REPOSITORY}=...), or clone the "
            "repository and open the chapter in its folder notebooks"
        )
    troubles = []
    for version in (f"v{__version__}", "main"):
        address = f"{repository}/raw/{version}/experiments/{file}"
        try:
            with urllib.request.urlopen(address, timeout=_SECONDS) as answer:
                content = answer.read()
        except (OSError, ValueError, http.client.HTTPException) as error:
            troubles.append(f"{address}: {error}")
            continue
        if hashlib.sha256(content).hexdigest() == digest:
            return content
        troubles.append(f"{address}: the content is not that of version {__version__} (another SHA-256)")
    raise ValueError(
        f"experiments/{file} could not be fetched ({'; '.join(troubles)}). Check the address in {REPOSITORY} and the "
        "connection, or clone the repository and open the chapter in its folder notebooks"
    )
