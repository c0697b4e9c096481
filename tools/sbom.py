"""Write the software bill of materials of the lock, as CycloneDX 1.6 JSON: ``python tools/sbom.py build/sbom.json``."""

import json
import sys
import uuid
from pathlib import Path

from packaging.utils import canonicalize_name

import meshot
from licences import LOCK, TABLE, locked_requirements, rows_of, version_of
from meshot.files import whole_file


def component(name: str, version: str, licence: str) -> dict:
    """One package in the format of CycloneDX."""
    url = f"pkg:pypi/{canonicalize_name(name)}@{version}"
    return {
        "type": "library",
        "bom-ref": url,
        "name": name,
        "version": version,
        "purl": url,
        "licenses": [{"license": {"name": licence}}],
    }


def bill_of(lock: str, table: str) -> dict:
    """The bill of materials of a lock. It contains no time, so that the same lock gives the same bill."""
    licences = {name: row[2] for name, row in rows_of(table).items()}
    parts = [component(r.name, version_of(r), licences[r.name]) for r in locked_requirements(lock)]
    whole = component("meshot", meshot.__version__, "MIT") | {"type": "application"}
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, lock + table + meshot.__version__)}",
        "version": 1,
        "metadata": {"component": whole},
        "components": parts,
    }


def main(path: str) -> None:
    """Write the bill of the committed lock."""
    bill = bill_of(LOCK.read_text(encoding="utf-8"), TABLE.read_text(encoding="utf-8"))
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(bill, indent=1) + "\n", encoding="utf-8")
    print(f"{len(bill['components'])} packages in {Path(path)}")


if __name__ == "__main__":
    main(sys.argv[1])
