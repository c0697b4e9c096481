"""The page of the command line, written from its parser when the book is built."""

import argparse
import re
import textwrap
from pathlib import Path

from sphinx.application import Sphinx

from meshot.cli import make_parser

WIDTH = 72
HEAD = """# Command line

This page lists every command and argument. It is generated from the parser of `meshot` when the book is built.
`meshot COMMAND --help` prints the same text.

The exit status of a command is 0 if it succeeds. It is 2 if the input cannot be used; one line then states the reason.
Warnings go to the standard error stream.
"""


def command_page(parser: argparse.ArgumentParser) -> str:
    """The page of a parser whose commands are subparsers, in MyST Markdown."""
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    helps = {choice.dest: choice.help for choice in commands._choices_actions}
    parts = [HEAD]
    for name, command in commands.choices.items():
        opening = _options_as_code(f"{_sentence(helps[name])} {command.description or ''}")
        parts.append(f"## `{parser.prog} {name}`\n\n{opening}\n")
        formatter = argparse.HelpFormatter(command.prog, width=WIDTH)
        formatter.add_usage(command.usage, command._actions, command._mutually_exclusive_groups)
        parts.append(f"```text\n{formatter.format_help().strip().removeprefix('usage: ')}\n```\n")
        formatter = argparse.HelpFormatter(command.prog, width=WIDTH)
        for action in (action for action in command._actions if action.dest != "help"):
            shown = formatter._format_action_invocation(action)
            said = _options_as_code(_sentence(formatter._expand_help(action))) if action.help else ""
            parts.append(f"`{shown}`\n: {said or 'See the usage above.'}\n")
        for text in filter(None, (command.epilog or "").split("\n\n")):
            # Lines of examples are indented.
            example = text.startswith("  ")
            parts.append(f"```sh\n{textwrap.dedent(text)}\n```\n" if example else f"{_options_as_code(text)}\n")
    return "\n".join(parts)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}."


def _options_as_code(text: str) -> str:
    """The text with options as code; otherwise Sphinx makes a dash of their two hyphens."""
    return re.sub(r"(?<![\w`-])--[a-z][\w-]*", lambda option: f"`{option[0]}`", text)


def write_page(app: Sphinx) -> None:
    """Write ``commands.md`` beside the other pages."""
    (Path(app.srcdir) / "commands.md").write_text(command_page(make_parser()), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the event."""
    app.connect("builder-inited", write_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
