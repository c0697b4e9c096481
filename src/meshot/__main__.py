"""``python -m meshot`` is ``meshot``."""

import sys

from meshot.cli import main

if __name__ == "__main__":
    sys.exit(main())
