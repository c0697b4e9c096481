"""The kernels of the notebooks, each on sockets of its own.

By default a kernel's manager chooses free TCP ports, and the kernel binds them a second later. Of kernels that start
side by side, about one in 200 finds a port taken: it dies or listens nowhere. A kernel here has IPC sockets in a
temporary folder that no other kernel knows.

As a plugin of pytest (``-p kernels``) this module gives such kernels to nbval.
"""

import shutil
import sys
import tempfile
import weakref

from jupyter_client.manager import KernelManager

#: nbformat loads jsonschema, which takes three seconds to make parsers of addresses if it finds this package; notebooks
#: hold no addresses to be checked. This module is loaded before nbformat.
sys.modules["rfc3987_syntax"] = None


class SeparateKernelManager(KernelManager):
    """Start a kernel on IPC sockets in a folder of its own; its error output goes where that of this process goes."""

    def __init__(self, **settings):
        # The path of a socket may have about 100 bytes, so the names are short.
        place = tempfile.mkdtemp(prefix="kernel-")
        weakref.finalize(self, shutil.rmtree, place, ignore_errors=True)
        super().__init__(transport="ipc", ip=f"{place}/s", connection_file=f"{place}/connection.json", **settings)

    def start_kernel(self, **options):
        """Start the kernel, without the redirection of its error output that nbval asks for."""
        options.pop("stderr", None)
        return super().start_kernel(**options)


def pytest_configure(config):
    """Let nbval start its kernels here."""
    import nbval.kernel

    nbval.kernel.KernelManager = SeparateKernelManager
