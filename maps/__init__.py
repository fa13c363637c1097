"""The environments that come with Sightline: one polygon file per map, in metres, with its source and licence."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent


def names() -> list[str]:
    """Names of the maps, in alphabetical order."""
    return sorted(file.stem for file in _FOLDER.glob("*.json"))


def path(name: str) -> Path:
    """File of the map `name`, for `Environment.load`.

    Raises `ValueError` with the names there are when `name` is none of them.
    """
    if name not in names():
        raise ValueError(
            f"there is no map '{name}': choose one of {', '.join(names())}, or give the path of a map file"
        )
    return _FOLDER / f"{name}.json"
