"""``sightline``: the command line."""

from __future__ import annotations

import os
from typing import Annotated

import typer

# The launcher forks, which is sound with one thread only; numpy's would be idle anyway.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from launcher.commands import live, map_facts, offline, plans, study
from launcher.usage import PlainGroup

app = typer.Typer(
    name="sightline",
    cls=PlainGroup,
    help="A team of robots keeps an unbroken line-of-sight chain between a base station and a walking agent.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

# A place like -3,4 looks like an option to the parser: what it does not know as one, it passes on as an argument.
_PLACES = {"ignore_unknown_options": True}

app.command()(live.demo)
app.command()(live.run)
app.command(context_settings=_PLACES)(live.goal)
app.command()(live.fault)
app.command()(offline.simulate)
app.command()(plans.plan)
app.command(name="map")(map_facts.show)
app.command()(offline.review)
app.add_typer(study.app, name="study")


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"sightline {version('sightline')}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Keep the docstring of the application; the option does its work by itself."""


def main() -> None:
    """Entry of the console script."""
    app()


if __name__ == "__main__":
    main()
