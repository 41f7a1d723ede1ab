"""Command line: what the Tab key completes in bash: commands, their options, and what options choose from.

Exit codes: 0 printed, 2 bad option.
"""

from __future__ import annotations

import argparse
import importlib

from colloc.commands.ending import OK, command
from colloc.commands.options import add_printing, new_parser, tell

_EPILOG = """\
Put this line into ~/.bashrc:

  eval "$(colloc completion)"

Where there is nothing of colloc to complete, files are."""
_SCRIPT = """\
_colloc() {{
    local words="" before="${{COMP_WORDS[COMP_CWORD-1]}}" now="${{COMP_WORDS[COMP_CWORD]}}"
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="{commands}"
    else
        case "${{COMP_WORDS[1]}} $before" in
{choices}
        *) [[ "$now" == -* ]] && case "${{COMP_WORDS[1]}}" in
{options}
            esac ;;
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$now"))
}}
complete -o default -F _colloc colloc"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("completion", "Print what bash needs to complete commands and options of colloc.", _EPILOG)
    add_printing(parser)
    return parser


def completion_script(parsers: dict[str, argparse.ArgumentParser]) -> str:
    """The text for bash, for the parsers of the commands."""
    options, choices = [], []
    for name, parser in parsers.items():
        actions = [action for action in parser._actions if action.option_strings]
        words = " ".join(sorted(word for action in actions for word in action.option_strings if word.startswith("--")))
        options.append(f'            {name}) words="{words}" ;;')
        for action in actions:
            if action.choices and not any(" " in choice for choice in action.choices):  # words, as compgen takes them
                listed = " ".join(action.choices)
                choices.append(f'        "{name} {action.option_strings[-1]}") words="{listed}" ;;')
    return _SCRIPT.format(commands=" ".join(parsers), choices="\n".join(choices), options="\n".join(options))


@command(_parser)
def main(options: argparse.Namespace) -> int:
    from colloc.commands.main import SUBCOMMANDS  # knows this module by name

    modules = {name: importlib.import_module(f"colloc.commands.{module}") for name, (module, _) in SUBCOMMANDS.items()}
    script = completion_script({name: module._parser() for name, module in modules.items()})
    tell(options, {"shell": "bash", "script": script}, [script])
    return OK
