"""Start many kernels side by side, and count those that die or do not answer: ``python tests/start_kernels.py 500``."""

import argparse
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tqdm import tqdm

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "book"))

from kernels import SeparateKernelManager


def start(_: int) -> str:
    """Start one kernel, let it compute, and end it; "answered", or what went wrong."""
    manager = SeparateKernelManager(kernel_name="python3")
    manager.start_kernel()
    client = manager.client()
    client.start_channels()
    try:
        client.wait_for_ready(timeout=60)
        reply = client.execute_interactive("assert 6 * 7 == 42", timeout=60)["content"]["status"]
        return "answered" if reply == "ok" else f"replied {reply}"
    except (RuntimeError, TimeoutError) as error:
        return str(error)
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def start_many(n_starts: int, n_at_once: int) -> Counter:
    """How often each outcome was found."""
    with ThreadPoolExecutor(n_at_once) as pool:
        return Counter(tqdm(pool.map(start, range(n_starts)), total=n_starts, unit="kernel", file=sys.stdout))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("starts", type=int, nargs="?", default=500)
    parser.add_argument("--at-once", type=int, default=3)
    options = parser.parse_args()
    outcomes = start_many(options.starts, options.at_once)
    print(dict(outcomes))
    sys.exit(set(outcomes) != {"answered"})
