"""``meshot completion``: completion of the command line by the tab key."""

from meshot.cli.common import Commands, add_command, known_systems


def add_to(commands: Commands) -> None:
    """Add the command ``completion`` to the parser."""
    command = add_command(
        commands,
        "completion",
        "Print a script with which the shell completes commands and options.",
        "The command prints a script for bash, which zsh reads as well. The shell then completes commands, options, "
        'names of systems and layouts, and files by the tab key. In the present shell: eval "$(meshot completion)". In '
        "every new one, for bash: write the script to ~/.local/share/bash-completion/completions/meshot.",
        "meshot completion",
    )
    command.set_defaults(run=lambda chosen: print(script(commands)))


def script(commands: Commands) -> str:
    """The script: for every command its options, and for every option with a choice the values."""
    cases = []
    for name, command in commands.choices.items():
        options = []
        for action in command._actions:
            options += action.option_strings
            values = known_systems() if action.dest == "system" else action.choices or ()
            place = action.option_strings or (name,)  # a name that is not an option follows the command
            cases += [f'    "{name} {word}") words="{" ".join(values)}" ;;' for word in place if values]
        cases.append(f'    "{name} "*) case "$word" in -*) words="{" ".join(options)}" ;; esac ;;')
    lines = "\n".join(cases)
    return f"""\
[ -n "$ZSH_VERSION" ] && autoload -U +X compinit bashcompinit && compinit && bashcompinit
_meshot() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words=""
  case "${{COMP_WORDS[1]}} ${{COMP_WORDS[COMP_CWORD-1]}}" in
{lines}
  esac
  [ "$COMP_CWORD" -eq 1 ] && words="{" ".join(commands.choices)} --help --version"
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _meshot meshot"""
