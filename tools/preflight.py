"""Look for missing system packages before anything is installed, and offer to install them.

Run as ``python3 tools/preflight.py [python] [display] [browser]``. All missing packages are listed with the reason why
they are needed. They are installed by apt-get if the user agrees on a terminal, or if ``YES=1`` is set. Otherwise
nothing is changed, and the command to run is printed. On Ubuntu the browser is downloaded by Playwright, since that of
apt-get is a snap. The syntax is limited to that of old Pythons.
"""

import ctypes
import glob
import importlib.util
import os
import shutil
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
DOWNLOADED = "~/.cache/ms-playwright/chromium-*/chrome-linux*/chrome"
MESA_DRIVERS = ("/usr/lib/*/dri/swrast_dri.so", "/usr/lib*/dri/swrast_dri.so", "/usr/lib*/*/libgallium*.so")


class Lack:
    """A missing requirement: the reason, the Debian packages that contain it, and commands that fetch it otherwise."""

    def __init__(self, why, *packages, commands=()):
        self.why = why
        self.packages = packages
        self.commands = commands


def missing_python():
    """What is missing in this Python, or None."""
    if sys.version_info < (3, 11):
        found = ".".join(str(part) for part in sys.version_info[:3])
        return Lack(f"Python {found} is too old, 3.11 or newer is needed: install one, then add PYTHON=python3.11")
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        return Lack("this Python cannot make the environment that everything is installed in", "python3-venv")
    return None


def missing_display():
    """Why surfaces cannot be drawn on this machine, or None. If VTK is installed, it is tested by drawing."""
    if importlib.util.find_spec("vtkmodules"):
        # In a second process, since VTK may crash.
        command = [sys.executable, "-m", "meshot.view.display"]
        asked = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        lacking = asked.returncode != 0
    else:
        lacking = bool(shutil.which("apt-get")) and not has_opengl()
    why = "the chapters draw surfaces with OpenGL, and no library was found that draws without a screen"
    return Lack(why, "libegl1", "libegl-mesa0", "libgl1-mesa-dri") if lacking else None


def has_opengl():
    """Whether the EGL libraries and a driver are installed, at the paths of Debian and Ubuntu."""
    if loads("libOSMesa.so.8") or loads("libOSMesa.so.6"):
        return True
    drawn_by_mesa = loads("libEGL_mesa.so.0") and any(glob.glob(pattern) for pattern in MESA_DRIVERS)
    return loads("libEGL.so.1") and (drawn_by_mesa or loads("libEGL_nvidia.so.0"))


def loads(library):
    """Whether a shared library can be loaded."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def browser():
    """The browser that the tests use, or None.

    MESHOT_BROWSER, or the first of the usual names on the path, or the one that ``playwright install`` downloads.
    """
    named = os.environ.get("MESHOT_BROWSER")
    downloaded = sorted(glob.glob(os.path.expanduser(DOWNLOADED)))
    return named or next((path for path in [*map(shutil.which, BROWSERS), *downloaded] if path), None)


def missing_browser():
    """Why the pages cannot be tested, or None."""
    if browser():
        return None
    why = "the tests open every page of the book in a browser (or name one: MESHOT_BROWSER=/path/to/chrome)"
    if system_name() == "ubuntu":
        # Ubuntu's chromium is a snap, which cannot read the pages under /tmp.
        return Lack(f"{why}. Playwright downloads one, since that of Ubuntu is a snap", commands=download_commands())
    return Lack(why, "chromium")


def download_commands():
    """How Playwright downloads a browser. If this Python lacks Playwright, an environment for it is made in build/."""
    download = ["-m", "playwright", "install", "--with-deps", "chromium"]
    if importlib.util.find_spec("playwright"):
        return [[sys.executable, *download]]
    place = os.path.join(ROOT, "build", "playwright")
    python = os.path.join(place, "bin", "python")
    install = [python, "-m", "pip", "install", "-q", locked("playwright")]
    return [[sys.executable, "-m", "venv", place], install, [python, *download]]


def locked(name):
    """A requirement with the version of the lock, such as playwright==1.65.2."""
    with open(os.path.join(ROOT, "requirements.lock"), encoding="utf-8") as file:
        return next(line.strip() for line in file if line.startswith(f"{name}=="))


def missing_driver():
    """Why the browser cannot be steered, or None. The program that steers it comes with playwright."""
    if sys.platform != "linux" or loads("libatomic.so.1"):
        return None
    return Lack("the tests steer the browser by a program that needs libatomic", "libatomic1")


def system_name():
    """The name of the Linux distribution, such as debian, or an empty string."""
    try:
        with open("/etc/os-release", encoding="utf-8") as file:
            names = [line[3:].strip('"\n ') for line in file if line.startswith("ID=")]
    except OSError:
        return ""
    return names[0] if names else ""


CHECKS = {"python": (missing_python,), "display": (missing_display,), "browser": (missing_browser, missing_driver)}


def lacks_of(names):
    """The missing requirements among those named."""
    return [lack for name in names for lack in (check() for check in CHECKS[name]) if lack]


def install_commands(packages):
    """The commands to run, as root or with sudo."""
    if not packages:
        return []
    prefix = [] if os.geteuid() == 0 else ["sudo"]
    return [
        [*prefix, "apt-get", "update", "-qq"],
        [*prefix, "apt-get", "install", "-y", "--no-install-recommends", *packages],
    ]


def agreed():
    """Whether to install the packages: YES=1, or an answer on a terminal. Without a terminal, no."""
    if os.environ.get("YES") == "1":
        return True
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return False
    try:
        return input("install them now? [y/N] ").strip().lower() in ("y", "yes")
    except EOFError:
        return False


def main(names):
    """List what is missing, and install it if the user agrees. Returns the exit status."""
    names = names or sorted(CHECKS)
    lacks = lacks_of(names)
    if not lacks:
        return 0
    packages = [package for lack in lacks for package in lack.packages]
    for lack in lacks:
        needed = f" {' '.join(lack.packages)}:" if lack.packages else ""
        print(f"missing:{needed} {lack.why}", flush=True)
    commands = install_commands(packages) + [command for lack in lacks for command in lack.commands]
    if not commands:
        return 1
    if packages and not shutil.which("apt-get"):
        print("there is no apt-get here: install what these Debian packages hold, then start again")
        return 1
    if not agreed():
        print("nothing was changed. Run this, or add YES=1 to have it done:")
        print("  " + " && ".join(" ".join(command) for command in commands), flush=True)
        return 1
    for command in commands:
        print("  " + " ".join(command), flush=True)
        if subprocess.run(command, check=False).returncode:
            print("this command failed; what it printed says why")
            return 1
    remaining = lacks_of(names)
    for lack in remaining:
        print(f"still missing: {lack.why}")
    return 1 if remaining else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
