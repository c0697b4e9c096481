"""Files of results, with everything needed to reproduce them."""

import datetime
import hashlib
import importlib.metadata
import json
import platform
import subprocess
from pathlib import Path

import torch

from meshot.files import write_whole

RECORDED = ("numpy", "scipy", "torch", "torchdiffeq", "POT", "geomloss", "libigl", "numba", "scikit-image", "nilearn")
PACKAGE = Path(__file__).parent
#: Code outside the package, as git path specifications.
OTHER_CODE = (":(top)src/meshot_book", ":(top,glob)experiments/**/*.py", ":(top,glob)experiments/**/*.yaml")
CPU_INFO = Path("/proc/cpuinfo")
#: Fields that every record has. Newer records have more.
FIELDS = ("results", "config", "command", "data", "seconds", "commit", "date", "versions", "machine")


def write_results(
    path: str | Path,
    results: dict,
    config: dict,
    command: str,
    data: str,
    seconds: float,
    made: dict | None = None,
) -> None:
    """Write a results file (JSON) with its provenance, completely or not at all."""
    record = {
        "results": results,
        "config": config,
        "command": command,
        "data": data,
        "seconds": round(seconds, 1),
    } | (made or provenance())
    try:
        text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"the results for {path} cannot be written as JSON ({error}); use finite numbers, lists, dicts"
        ) from error
    write_whole(path, text + "\n")


def rounded(value: object) -> object:
    """The value with every float rounded to six significant digits, also in nested dicts and lists."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def provenance() -> dict:
    """The commit, the date, the versions of the libraries, the machine and the processor."""
    return {
        "commit": commit_of(PACKAGE),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d"),
        "versions": {"python": platform.python_version()} | {name: package_version(name) for name in RECORDED},
        "machine": f"{platform.machine()}, {torch.get_num_threads()} threads, "
        f"{torch.backends.cpu.get_cpu_capability()}",
        "processor": processor(),
    }


def processor() -> str:
    """The model of the processor and its instruction set. The last bits of results depend on them."""
    lines = CPU_INFO.read_text(encoding="utf-8").splitlines() if CPU_INFO.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    model = next(iter(models), "") or platform.processor() or platform.machine() or "unknown model"
    return f"{model}, {torch.backends.cpu.get_cpu_capability()}"


def read_results(path: str | Path) -> dict:
    """Read a results file and check that its provenance is complete."""
    path = Path(path)
    if not path.is_file():
        raise ValueError(
            f"{path} does not exist. It is part of the repository; clone it again, or run the experiment that makes "
            "the file (see experiments/README.md)"
        )
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not whole JSON ({error}); run its experiment again") from error
    missing = [field for field in FIELDS if not isinstance(record, dict) or field not in record]
    if missing:
        raise ValueError(
            f"{path} lacks {', '.join(missing)}; results without provenance do not count: run its experiment again"
        )
    return record


def provenance_lines(record: dict) -> str:
    """The provenance of a record, as text to print under a table or a figure."""
    versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    by = f" ({record['processor']})" if "processor" in record else ""
    return (
        f"made by   {record['command']}\ncommit    {record['commit']}, {record['date']}\ndata      {record['data']}\n"
        f"took      {record['seconds']} s on {record['machine']}{by}\nversions  {versions}"
    )


def file_digest(path: str | Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def package_version(name: str) -> str:
    """The installed version of a distribution, or "not installed"."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def commit_of(package: Path) -> str:
    """The commit of the checkout that contains the package, with "+changes" if code has changed since."""
    # Code means tracked files of the package and of the book's package, and scripts and settings in ``experiments/``.
    # Results do not count.
    try:
        head = subprocess.run(
            ["git", "rev-parse", "--short=12", "HEAD"], cwd=package, capture_output=True, text=True, check=True
        )
        changed = subprocess.run(
            ["git", "diff", "--quiet", "HEAD", "--", ".", *OTHER_CODE], cwd=package, check=False
        ).returncode
    except (OSError, subprocess.CalledProcessError):
        return "not in a git checkout"
    return head.stdout.strip() + ("+changes" if changed else "")
