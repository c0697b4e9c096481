"""The note that every command prints, and the type of the parser's commands."""

import argparse

NOTE = "Not for clinical use."

#: The return type of ``ArgumentParser.add_subparsers``.
Commands = argparse._SubParsersAction
