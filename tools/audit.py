"""Check the locked packages against a database of known vulnerabilities: ``python tools/audit.py`` (needs a network).

The exit status is 0 if no vulnerability is known, 1 if one is known, and 2 if the database could not be queried.
"""

import json
import subprocess
import sys
from pathlib import Path

LOCK = Path(__file__).resolve().parent.parent / "requirements.lock"
PINNED = ["--no-deps", "--disable-pip", "--strict"]
UNKNOWN = 2


def said_of(report: str) -> list[str]:
    """One line for each vulnerability in a JSON report. Raises ValueError if the text is not such a report."""
    found = json.loads(report)["dependencies"]
    if not found:
        raise ValueError("the report names no package")
    return [f"{p['name']} {p['version']}: {v['id']}, mended in {', '.join(v['fix_versions']) or 'no version yet'}"
            for p in found for v in p["vulns"]]  # fmt: skip


def main() -> int:
    """Run pip-audit and print the vulnerabilities. Returns the exit status."""
    command = [sys.executable, "-m", "pip_audit", "-s", "osv", "-f", "json", "-r", str(LOCK), *PINNED]
    asked = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        lines = said_of(asked.stdout)
    except (ValueError, KeyError, TypeError):
        reason = next(reversed(asked.stderr.strip().splitlines()), "no reason was given")
        print("nothing is known: the database of vulnerabilities (osv.dev) could not be asked")
        print(f"  {reason}")
        return UNKNOWN
    print("\n".join(lines) if lines else "no vulnerability is known in the locked packages")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
