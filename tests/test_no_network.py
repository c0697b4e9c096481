"""Importing and running the package connects to nothing: sockets are refused in a process of its own."""

import subprocess
import sys

import pytest

REFUSE = """
import sys
def refuse(event, arguments):
    # A socket alone is nothing yet. urllib3 binds one to this machine when it is imported, to see whether it has IPv6.
    own = event == "socket.__new__" or event == "socket.bind" and arguments[1][0] in ("::1", "127.0.0.1")
    if event.startswith("socket.") and not own:
        print("SOCKET", event, arguments[1:], flush=True)
        raise PermissionError("sockets are refused")
sys.addaudithook(refuse)
"""
IMPORT_ALL_AND_RUN = """
import importlib, pathlib, pkgutil, sys, tempfile
import meshot, meshot_book
for package in (meshot, meshot_book):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("__main__"):
            found = importlib.import_module(module.name)
            [getattr(found, name) for name in getattr(found, "__all__", ())]

from meshot.anatomy import mni152_t1
from meshot.mesh.shapes import icosphere
from meshot.provenance import provenance
folder = pathlib.Path(tempfile.mkdtemp(dir=sys.argv[1]))
small = icosphere(1)
large = small.with_vertices(1.1 * small.vertices)
for name, mesh in (("a.ply", small), ("b.ply", large)):
    meshot.write_mesh(folder / name, mesh)
assert meshot.sliced_wasserstein(meshot.surface(small), meshot.surface(large)) >= 0
assert mni152_t1() is not None
provenance()
print("done")
"""


def refused(code: str, *arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-c", REFUSE + code, *arguments]
    return subprocess.run(command, capture_output=True, encoding="utf-8", check=False)


def test_nothing_is_connected_to(tmp_path):
    done = refused(IMPORT_ALL_AND_RUN, str(tmp_path))
    assert "SOCKET" not in done.stdout
    assert done.stdout.splitlines()[-1:] == ["done"], done.stderr


@pytest.mark.parametrize(
    "code",
    [
        "import urllib.request; urllib.request.urlopen('http://127.0.0.1:9')",
        "import socket; socket.socket(type=socket.SOCK_DGRAM).sendto(b'a', ('127.0.0.1', 9))",
        "import socket; socket.socket().bind(('0.0.0.0', 0))",
        "import socket; socket.getaddrinfo('localhost', 80)",
    ],
)
def test_a_connection_is_seen(code):
    done = refused(code)
    assert done.returncode != 0
    assert "SOCKET" in done.stdout
