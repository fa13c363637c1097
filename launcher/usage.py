"""Command lines that cannot be read: one sentence, as for every other fault, and exit status 2.

typer answers with the usage and a box of several lines, which names neither the value nor, of places among the
arguments, what belongs there.
"""

from __future__ import annotations

import sys
from typing import Any

import typer
from typer.core import TyperGroup

from launcher.console import BAD_INPUT, complain

_UNREADABLE: type[Exception] = typer.BadParameter.__mro__[1]
"""What all faults of this kind have in common; typer names only some of them in public."""

_NUMBERS = {"int_parsing": "whole number", "int_from_float": "whole number", "float_parsing": "number"}


class PlainGroup(TyperGroup):
    """Commands whose faults of usage are sentences."""

    def main(self, *arguments: Any, **settings: Any) -> Any:
        """As typer's, which see; ends the process."""
        try:
            status = super().main(*arguments, **{**settings, "standalone_mode": False})
        except _UNREADABLE as problem:
            # Without a command the help has been printed, and there is nothing to add.
            if type(problem).__name__ != "NoArgsIsHelpError":
                words = settings.get("args") or [*arguments, sys.argv[1:]][0] or ()
                named = [word for word in words[:1] if word in self.commands]
                complain(describe(problem, " ".join(["sightline", *named])))
            sys.exit(BAD_INPUT)
        except typer.Abort:
            sys.exit(1)
        sys.exit(status)


def describe(problem: Any, asked: str = "sightline") -> str:
    """What cannot be read, why, and what to do, in a sentence.

    Args:
        asked: the command; some problems do not tell.
        problem: typer's; what it does not tell of itself is made up for by the help that is pointed to.
    """
    context, parameter = getattr(problem, "ctx", None), getattr(problem, "param", None)
    command = asked if context is None else context.command_path
    asking = f"see {command} --help"
    if parameter is None:
        text = problem.message.removesuffix(".").replace(". Did", "; did")
        if nearest := getattr(problem, "possibilities", None):
            text = f"{text}; did you mean {' or '.join(sorted(nearest))}?"
        return f"{text[:1].lower()}{text[1:]}" + ("" if text.endswith("?") else f"; {asking}")
    metavar = parameter.metavar or ""
    is_option = parameter.param_type_name == "option"
    place = parameter.opts[-1] if is_option else metavar or parameter.name.upper()
    if problem.message == "":
        return f"{command.rpartition(' ')[2]} needs {' '.join(dict.fromkeys((place, metavar))).strip()}; {asking}"
    causes: list[dict[str, Any]] = getattr(problem.__cause__, "errors", list)()
    if not causes:
        return f"{place}: {problem.message.removesuffix('.')}; {asking}"
    kind, given = causes[0]["type"], causes[0]["input"]
    if kind in _NUMBERS:
        return f"{place} {given!r} is no {_NUMBERS[kind]}; give one, or {asking}"
    if parameter.min is not None and parameter.max is not None:
        return f"{place} {given} is out of range; give a number from {parameter.min:g} to {parameter.max:g}"
    if parameter.min is not None:
        return f"{place} {given} is out of range; give a number of at least {parameter.min:g}"
    return f"{place}: {causes[0]['msg'].removeprefix('Value error, ').removesuffix('.')}; give one of them"
