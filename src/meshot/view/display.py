"""A check that VTK can draw on this machine. Without OpenGL, VTK ends with a segmentation fault.

``python -m meshot.view.display`` prints the result and exits with 0 or 1.
"""

import contextlib
import functools
import importlib
import os
import subprocess
import sys

VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
WINDOWS = {
    "linux": ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"),
    "darwin": ("vtkCocoaRenderWindow",),
    "win32": ("vtkWin32OpenGLRenderWindow",),
}
REMEDY = (
    "surfaces cannot be drawn: no OpenGL was found. On Debian or Ubuntu: "
    "apt-get install libegl1 libgl1-mesa-dri (or libosmesa6)"
)
#: Modules with an LLVM of their own. PyTorch builds with CUDA import them, for example for an optimiser. If Mesa has
#: loaded its LLVM before, the import ends with a segmentation fault; in the other order both work.
BEFORE_OPENGL = ("triton",)
#: Seconds after which a trial counts as failed. The first start of VTK on a slow, busy machine took more than a minute.
PATIENCE = 300
# Only drawing is a reliable test: a library may load without a device, and VTK then crashes. VTK makes the window,
# since some of its versions crash if the class of the window is called.
_TRIAL = """
import sys
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.Render()
sys.exit(0 if window.GetClassName() == sys.argv[1] and window.SupportsOpenGL() else 1)
"""


@functools.cache
def usable_window() -> str | None:
    """The name of a VTK window class that can draw off screen on this machine, or None."""
    # Each candidate draws once in a separate process (.3 s), so that a crash does no harm. The class named by the
    # environment variable ``VTK_DEFAULT_OPENGL_WINDOW`` is tried first.
    candidates = dict.fromkeys([os.environ.get(VARIABLE, ""), *WINDOWS.get(sys.platform, WINDOWS["linux"])])
    return next((name for name in candidates if name and _draws(name)), None)


def _draws(window: str) -> bool:
    trial = [sys.executable, "-c", _TRIAL, window]
    try:
        ended = subprocess.run(
            trial, env=os.environ | {VARIABLE: window}, capture_output=True, timeout=PATIENCE, check=False
        )
        return ended.returncode == 0
    except subprocess.TimeoutExpired:
        return False


def require_display() -> None:
    """Make VTK use the window class that works on this machine. Must be called before the first picture.

    Raises
    ------
    RuntimeError
        If none works. The message names packages to install.
    """
    window = usable_window()
    if window is None:
        raise RuntimeError(REMEDY)
    os.environ[VARIABLE] = window
    for name in BEFORE_OPENGL:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def main() -> int:
    """Print the result of the check. The exit status is 0 if surfaces can be drawn, else 1."""
    window = usable_window()
    print(REMEDY if window is None else f"surfaces can be drawn ({window})", file=sys.stdout if window else sys.stderr)
    return 0 if window else 1


if __name__ == "__main__":
    sys.exit(main())
