"""Compiling the numerical kernels once, in one process, before a team of processes needs them all at the same time.

numba keeps compiled kernels beside the source or, where that is read-only, in the user's cache folder. It takes a kept
kernel to be fresh while the kernel's *own* file is unchanged, although a kernel contains the code of those that it
calls. So a stamp named after all sources, the versions and the processor says that everything was compiled together;
where the stamp is missing, what was kept is thrown away first.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

PACKAGES: tuple[str, ...] = ("planning", "estimation")
"""Packages with kernels; each has a module ``warm_up`` whose ``exercise`` runs them all."""


def warm_up(announce: Callable[[str], None] = lambda _: None, packages: Sequence[str] = ()) -> bool:
    """Compile every kernel unless that has been done; say so through ``announce`` beforehand.

    To be called before the first kernel of the process: what it has loaded it keeps.

    Args:
        announce: is told before anything that takes long.
        packages: those that are needed; all if empty.

    Returns:
        Whether anything had to be compiled.
    """
    stale = [package for package in packages or PACKAGES if not _stamp(package).exists()]
    if stale:
        announce("Compiling the numerical kernels (once for this version; a minute or two) ...")
    for package in stale:
        _compile(package)
    return bool(stale)


def _compile(package: str) -> None:
    from importlib import import_module

    stamp = _stamp(package)
    for file in (*stamp.parent.glob("*.nbi"), *stamp.parent.glob("*.nbc"), *stamp.parent.glob("kernels-*.ready")):
        file.unlink(missing_ok=True)
    import_module(f"{package}.warm_up").exercise()
    stamp.parent.mkdir(parents=True, exist_ok=True)
    stamp.touch()


def _stamp(package: str) -> Path:
    """The file that says that a package's kernels are compiled: beside them, or in the user's cache."""
    import llvmlite.binding

    folder = Path(__file__).parents[1] / package
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.py")):
        digest.update(file.read_bytes())
    for word in (sys.version, version("numba"), llvmlite.binding.get_host_cpu_name()):
        digest.update(word.encode())
    beside = folder / "__pycache__"
    if not os.access(beside if beside.exists() else folder, os.W_OK):
        beside = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "sightline" / package
    return beside / f"kernels-{digest.hexdigest()[:16]}.ready"
