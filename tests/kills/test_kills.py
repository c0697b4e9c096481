"""A sample of kills, and that each kind of damage would be seen; ``make kill`` kills everything that writes."""

import subprocess
import sys

import pytest

#: Writers with a defect, and what has to be said of each.
PLANTED = {
    "half": ("def write(folder, inputs):\n    folder.mkdir(exist_ok=True)\n    with open(folder / 'a', 'w') as f:\n"
             "        for k in range(50): f.write('x' * 9000); time.sleep(.01)", "a is not what a whole run writes"),
    "json": ("def write(folder, inputs):\n    folder.mkdir(exist_ok=True)\n"
             "    with open(folder / 'a.json', 'w') as f:\n"
             "        for k in range(50): f.write('1' * 90); time.sleep(.01)\n"
             "    (folder / 'a.json').write_text('1')", "a.json can not be read"),
    "orphan": ("def write(folder, inputs):\n    folder.mkdir(exist_ok=True)\n"
               "    p = subprocess.Popen(['sleep', '60'], start_new_session=True); time.sleep(.4); p.kill()\n"
               "    (folder / 'a').touch()", "outlived its parent"),
    "never again": ("def write(folder, inputs):\n    folder.mkdir(); time.sleep(.4); (folder / 'a').touch()",
                    "the second start"),
    "left": ("def write(folder, inputs):\n    (folder.parent / '.writing-x').mkdir(parents=True, exist_ok=True)\n"
             "    time.sleep(.4); folder.mkdir(exist_ok=True); (folder / 'a').touch()", ".writing-x was left"),
    "no room": ("def write(folder, inputs):\n    try:\n        folder.mkdir(exist_ok=True)\n"
                "        (folder / 'a').write_bytes(bytes(100_000))\n    except OSError: pass", "no room: status 0"),
    "two": ("import fcntl\n"
            "def write(folder, inputs):\n    busy = open(folder.parent / 'busy', 'w')\n"
            "    try: fcntl.flock(busy, fcntl.LOCK_EX | fcntl.LOCK_NB)\n"
            "    except OSError: raise RuntimeError('busy')\n"
            "    time.sleep(.5)\n    with whole_folder(folder, replace=True) as whole: (whole / 'a').touch()",
            "two at once ended with [0, 1]"),
    "other bytes": ("def write(folder, inputs):\n    folder.mkdir(exist_ok=True)\n"
                    "    (folder / 'a').write_text(str(time.time_ns()))",
                    "a is not what a whole run writes"),
}  # fmt: skip
SOUND = """
def write(folder, inputs):
    with whole_folder(folder, replace=True) as temporary:
        (temporary / 'a').write_bytes(bytes(100_000))
"""
CODE = """
import subprocess, sys, time
from pathlib import Path
sys.path.insert(0, {here!r})
import kill_trials
from meshot.files import whole_folder
kill_trials.PATIENCE = 0.5
{write}
print("\\n".join(kill_trials.trials(kill_trials.Writer("planted", write), Path(), 3)))
print("done")
"""


def troubles_of(root, write: str) -> list[str]:
    code = CODE.format(here=str(root / "tests" / "kills"), write=write)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=False)
    assert done.stdout.endswith("done\n"), done.stderr
    return [line for line in done.stdout.splitlines()[:-1] if line]


@pytest.mark.parametrize("name", PLANTED)
def test_what_a_kill_should_not_leave_is_seen(root, name):
    write, expected = PLANTED[name]
    assert expected in "\n".join(troubles_of(root, write))


def test_what_is_written_whole_has_no_troubles(root):
    assert troubles_of(root, SOUND) == []


def test_a_sample_of_kills(root):
    """Tasks of an experiment, a fit, meshes and scans."""
    command = [sys.executable, str(root / "tests" / "kills" / "run.py"), "--sample", "--kills", "2"]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stdout + done.stderr
