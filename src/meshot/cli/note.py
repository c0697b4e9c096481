"""What every command says of itself."""

import argparse

NOTE = "Not for clinical use."

#: What ``ArgumentParser.add_subparsers`` gives.
Commands = argparse._SubParsersAction
