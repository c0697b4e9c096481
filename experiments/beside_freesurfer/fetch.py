"""Fetch S1, one adult's scan with FreeSurfer's surfaces: run as ``make person``.

The files are in the source distribution of pycortex (BSD-2). pip downloads it, so that any index that pip knows
serves. The archive and the scan are checked against the digests in ``config.yaml``, and unpacked into ``folder``.
"""

import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import yaml

from meshot.files import whole_file
from meshot.provenance import file_digest

ROOT = Path(__file__).resolve().parents[2]


def require_digest(file: Path, expected: str) -> None:
    """Check that a file is the one that was measured."""
    found = file_digest(file)
    if found != expected:
        raise ValueError(
            f"{file.name} has the SHA-256 {found}; {expected} is expected: the file was cut short, or the index has "
            "another one. Delete it and fetch it again, or from another index"
        )


def download(package: str, folder: Path) -> Path:
    """The source distribution of a package, by pip."""
    name = package.split("==", maxsplit=1)[0]
    command = [sys.executable, "-m", "pip", "download", "--no-deps", f"--no-binary={name}", "-d", str(folder), package]
    if subprocess.run(command, check=False).returncode:
        raise ValueError(f"pip did not fetch {package}: see what it says above, and try again with a network")
    (file,) = folder.glob("*.tar.gz")
    return file


def unpack(archive: Path, files: dict[str, str], folder: Path) -> None:
    """Write some files of an archive into a folder. Their names in the archive begin with that of the package."""
    folder.mkdir(parents=True, exist_ok=True)
    with tarfile.open(archive) as packed:
        top = packed.getnames()[0].split("/")[0]
        for member, name in files.items():
            with packed.extractfile(f"{top}/{member}") as content, whole_file(folder / name) as temporary:
                Path(temporary).write_bytes(content.read())


def main() -> int:
    """Fetch what is missing."""
    config = yaml.safe_load(Path(__file__).with_name("config.yaml").read_text(encoding="utf-8"))
    source, folder = config["source"], ROOT / config["folder"]
    try:
        if not all((folder / name).is_file() for name in source["files"].values()):
            with tempfile.TemporaryDirectory() as place:
                archive = download(source["package"], Path(place))
                require_digest(archive, source["archive_sha256"])
                unpack(archive, source["files"], folder)
        require_digest(folder / "scan.nii.gz", source["scan_sha256"])
    except ValueError as error:
        print(f"fetch: {error}", file=sys.stderr)
        return 2
    print(f"S1 is in {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
