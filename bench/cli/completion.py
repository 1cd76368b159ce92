"""`bench completion`: a script that completes commands, options and names in bash, zsh and fish.

What can be typed is written into the script; names of procedures, rigs, campaigns and runs are asked for when a key is pressed.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer

from bench.cli.completing import HIDDEN, NAMES, SHELLS
from bench.errors import ConfigError

ADDED = {
    "bash": 'eval "$(bench completion bash)"  # in ~/.bashrc',
    "zsh": 'eval "$(bench completion zsh)"  # in ~/.zshrc, after compinit',
    "fish": "bench completion fish > ~/.config/fish/completions/bench.fish",
}


@dataclass(frozen=True)
class Taken:
    """What an option or an argument takes: words, names of a `kind` of `bench.cli.completing`, or files; nothing of a flag."""

    flags: tuple[str, ...]
    words: tuple[str, ...]
    kind: str
    flag: bool
    about: str


@dataclass(frozen=True)
class Command:
    """A command with its options and its arguments in order."""

    name: str
    about: str
    options: tuple[Taken, ...]
    arguments: tuple[Taken, ...]


def completion_command(shell: str, app: typer.Typer) -> int:
    """Write the script of a shell, by default of the one that is used, and how it is taken up.

    Raises:
        ConfigError: none is known of that name.
    """
    name = shell or Path(os.environ.get("SHELL", "")).name
    if name not in SHELLS:
        raise ConfigError(f"found shell {name!r}; expected one of {', '.join(SHELLS)}. Next: bench completion bash")
    commands = tuple(commands_of(app))
    sys.stdout.write(_fish(commands) if name == "fish" else _bash(commands, zsh=name == "zsh"))
    if sys.stdout.isatty():
        sys.stderr.write(f"take it up with: {ADDED[name]}\n")
    return 0


def commands_of(app: typer.Typer) -> Iterator[Command]:
    """Every command of the application, in the order of `--help`."""
    group: Any = typer.main.get_command(app)
    for (name, command), declared in zip(group.commands.items(), app.registered_commands, strict=True):
        hints = get_type_hints(declared.callback)
        taken = [(p, _taken(p, hints.get(p.name))) for p in command.params]
        yield Command(
            name,
            (command.help or "").strip().split("\n")[0],
            tuple(t for p, t in taken if p.param_type_name == "option"),
            tuple(t for p, t in taken if p.param_type_name == "argument"),
        )


def _taken(parameter: Any, hint: Any) -> Taken:
    choices = [kind for kind in (hint, *get_args(hint)) if isinstance(kind, type) and issubclass(kind, StrEnum)]
    words = tuple(word.value for kind in choices for word in kind)
    flags = tuple(parameter.opts) if parameter.param_type_name == "option" else ()
    kind = parameter.metavar if parameter.metavar in NAMES and not (flags and parameter.metavar == "FILE") else ""
    about = (getattr(parameter, "help", "") or "").strip()
    return Taken(flags, words, kind, hint is bool or parameter.name == "help", about)


def _asked(*taken: Taken) -> str:
    """Where the words come from, in a shell: names are asked for, a line each, as they may have blanks."""
    names = "\n".join(f"$(bench {HIDDEN} {one.kind})" for one in taken if one.kind)
    words = " ".join(word for one in taken if not one.kind for word in one.words)
    return f'names="{names}"' if names and not words else f'words="{words}"' + (f' names="{names}"' if names else "")


def _bash(commands: tuple[Command, ...], *, zsh: bool) -> str:
    """Files are offered where nothing else fits. zsh takes the script of bash."""
    lines = ["autoload -U bashcompinit && bashcompinit"] if zsh else []
    lines += [
        "_bench() {",
        '  local now="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" words="" names="" name',
        f'  local all="{" ".join(c.name for c in commands)} --help --version"',
        '  if [ "$COMP_CWORD" -eq 1 ]; then words="$all"; else case "${COMP_WORDS[1]}" in',
        *(line for c in commands for line in _bash_command(c)),
        "  esac; fi",
        '  COMPREPLY=($(compgen -W "$words" -- "$now"))',
        "  while IFS= read -r name; do",
        '    printf -v name %q "$name"',
        """    case "$name" in "''") ;; "$now"*) COMPREPLY+=("$name") ;; esac""",
        '  done <<< "$names"',
        "}",
        "complete -o default -F _bench bench",
    ]
    return "\n".join(lines) + "\n"


def _bash_command(command: Command) -> Iterator[str]:
    valued = [o for o in command.options if not o.flag]
    yield f'    {command.name}) case "$before" in'
    for option in valued:
        yield f"      {'|'.join(option.flags)}) {_asked(option)} ;;"
    flags = " ".join(flag for o in command.options for flag in o.flags if flag.startswith("--"))
    yield f'      *) case "$now" in -*) words="{flags} --help" ;; *) {_asked(*command.arguments)} ;; esac ;;'
    yield "    esac ;;"


def _fish(commands: tuple[Command, ...]) -> str:
    lines = [f"complete -c bench -f -n __fish_use_subcommand -a {c.name} -d {shlex.quote(c.about)}" for c in commands]
    for c in commands:
        within = f"-n '__fish_seen_subcommand_from {c.name}'"
        named = [argument for argument in c.arguments if argument.kind or argument.words]
        lines += [f"complete -c bench {within} -a {_fish_words(argument)}" for argument in named]
        for option in c.options:
            flag = next(f for f in option.flags if f.startswith("--")).removeprefix("--")
            values = "" if option.flag else f" -r -a {_fish_words(option)}" if option.kind or option.words else " -r"
            lines.append(f"complete -c bench {within} -l {flag}{values} -d {shlex.quote(option.about)}")
    return "\n".join(lines) + "\n"


def _fish_words(taken: Taken) -> str:
    return f"'(bench {HIDDEN} {taken.kind})'" if taken.kind else shlex.quote(" ".join(taken.words))
