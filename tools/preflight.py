"""Check requirements before installing or drawing: each missing one is reported in one line with its remedy.

Run as ``python3 tools/preflight.py [python] [display] [browser]``. The syntax is limited to that of old Pythons.
"""

import os
import shutil
import subprocess
import sys

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def missing_python():
    """What is missing in this Python, or None."""
    if sys.version_info < (3, 11):
        found = ".".join(str(part) for part in sys.version_info[:3])
        return f"Python {found} is too old, 3.11 or newer is needed: install one, then add PYTHON=python3.11 to make"
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        return "this Python cannot make environments: sudo apt-get install python3-venv"
    return None


def missing_display():
    """Why VTK cannot draw, or None. Tested in another process, since VTK may crash."""
    command = [sys.executable, "-m", "meshot.view.display"]
    asked = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    if asked.returncode == 0:
        return None
    return asked.stdout.decode().strip() or "VTK cannot draw here: sudo apt-get install libegl1 libgl1-mesa-dri"


def browser():
    """The browser that the tests use: MESHOT_BROWSER, or the first common name on the path, or None."""
    named = os.environ.get("MESHOT_BROWSER")
    return named or next((path for path in map(shutil.which, BROWSERS) if path), None)


def missing_browser():
    """How to get a browser if there is none, or None."""
    if browser():
        return None
    remedy = "sudo apt-get install chromium, or set MESHOT_BROWSER=/path/to/chrome"
    return "the tests open every page in a browser and found none: " + remedy


CHECKS = {"python": missing_python, "display": missing_display, "browser": missing_browser}


def main(names):
    """Print the first missing requirement of those named. Returns the exit status."""
    for name in names or sorted(CHECKS):
        trouble = CHECKS[name]()
        if trouble:
            print(trouble)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
