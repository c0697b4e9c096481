"""The quick part of the emulated machines; ``make test-everywhere`` runs all numerical tests on each of them."""

import json

from scripts import scripts_in

SEEN = """
import json, locale, time
import meshot, torch
from numpy._core import _multiarray_umath as numpy
vectors = [name for name in numpy.__cpu_dispatch__ if numpy.__cpu_features__[name]]
encoding = locale.getpreferredencoding(False)
print(json.dumps([torch.backends.cpu.get_cpu_capability(), vectors, encoding, time.timezone]))
"""


def test_values_are_the_same_on_an_old_processor_elsewhere(root):
    """Sliced, windowed, Chamfer, exact and Sinkhorn losses against closed forms; and the switches are thrown."""
    with scripts_in(root / "tests" / "everywhere") as load:
        machines = load("run")
    seen = json.loads(machines.run_on(machines.OLD, "-c", SEEN).stdout.splitlines()[-1])
    assert seen[0] in ("DEFAULT", "NO AVX")  # as this and as earlier versions of torch call it
    assert seen[1:] == [[], "ANSI_X3.4-1968", 35100]
    done = machines.run_on(machines.OLD, "-m", "pytest", "-p", "no:cacheprovider", "tests/loss/test_values.py")
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout
