"""What the help of all commands has in common: the note that each prints, paragraphs, and examples."""

import argparse

NOTE = "Not for clinical use."

#: The return type of ``ArgumentParser.add_subparsers``.
Commands = argparse._SubParsersAction


class HelpParagraphs(argparse.HelpFormatter):
    """A formatter that fills each paragraph by itself and keeps the lines of examples, which are indented."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = text.split("\n\n")
        return "\n\n".join(
            part if part.startswith("  ") else super(HelpParagraphs, self)._fill_text(part, width, indent)
            for part in paragraphs
        )


def add_command(
    commands: Commands, name: str, summary: str, description: str, examples: str, more: str = "", usage: str = ""
) -> argparse.ArgumentParser:
    """Add a command whose help ends with examples.

    Parameters
    ----------
    commands : Commands
    name : str
    summary : str
        One line for the list of all commands.
    description : str
        What the command does, in sentences.
    examples : str
        One command on each line.
    more : str
        What stands between the arguments and the examples.
    usage : str
        In place of the usage that argparse would print.
    """
    lines = [f"  {line.strip()}" for line in examples.strip().splitlines()]
    heading = "Example:" if len(lines) == 1 else "Examples:"
    return commands.add_parser(
        name,
        help=summary,
        usage=usage or None,
        description=description,
        epilog="\n\n".join([*([more] if more else []), heading, "\n".join(lines)]),
        formatter_class=HelpParagraphs,
    )
