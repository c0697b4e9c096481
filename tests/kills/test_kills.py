"""A sample of kills; ``make kill`` kills everything that writes."""

import subprocess
import sys


def test_a_sample_of_kills(root):
    """Tasks of an experiment, a fit, meshes and scans."""
    command = [sys.executable, str(root / "tests" / "kills" / "run.py"), "--sample", "--kills", "2"]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stdout + done.stderr
