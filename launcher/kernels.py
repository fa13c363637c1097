"""Compiling the numerical kernels once, in one process, before a team of processes needs them all at the same time.

numba keeps compiled kernels beside the source or, where that is read-only, in the user's cache folder. It takes a kept
kernel to be fresh while the kernel's *own* file is unchanged, although a kernel contains the code of those that it
calls. So a stamp says what was compiled together: for each module with kernels a digest of its source, of all that it
imports from its package, of the versions and of the processor. The kept kernels of a module with another digest are
thrown away before they can be used.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import sys
from collections.abc import Callable, Sequence
from functools import cache
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
    stale = {package: modules for package in packages or PACKAGES if (modules := _stale_modules(package))}
    if stale:
        announce("Compiling the numerical kernels (once for this version; some minutes) ...")
    for package, modules in stale.items():
        _compile(package, modules)
    return bool(stale)


def _compile(package: str, stale: Sequence[str]) -> None:
    from importlib import import_module

    stamp = _stamp(package)
    for module in stale:
        for file in (*stamp.parent.glob(f"{module}.*.nbi"), *stamp.parent.glob(f"{module}.*.nbc")):
            file.unlink(missing_ok=True)
    digests = _digests(package)
    import_module(f"{package}.warm_up").exercise()
    stamp.parent.mkdir(parents=True, exist_ok=True)
    # Whole or not at all, also when two processes compile at the same time.
    fresh = stamp.with_suffix(f".{os.getpid()}")
    fresh.write_text(json.dumps(digests, indent=0), encoding="utf-8")
    fresh.replace(stamp)


def _stale_modules(package: str) -> list[str]:
    """Modules whose kernels were not compiled from what is in the files now."""
    try:
        kept = json.loads(_stamp(package).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        kept = {}
    return [module for module, digest in _digests(package).items() if kept.get(module) != digest]


def _digests(package: str) -> dict[str, str]:
    """For each module with kernels, and for the one that runs them all, what its kernels depend on."""
    folder = _folder(package)
    sources = {file.stem: file.read_bytes() for file in sorted(folder.glob("*.py"))}
    imports = {module: _imports(package, source) & sources.keys() for module, source in sources.items()}
    digests = {"warm_up": _digest([sources["warm_up"]])}
    for module in sources:
        if "kernel" in imports[module] and module != "warm_up":
            needed, waiting = {module}, [module]
            while waiting:
                new = imports[waiting.pop()] - needed
                needed |= new
                waiting += new
            digests[module] = _digest([sources[name] for name in sorted(needed)])
    return digests


@cache
def _imports(package: str, source: bytes) -> set[str]:
    """Modules of the package that a source imports anywhere."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{package}."):
            found.add((node.module or "").split(".")[1])
    return found


def _digest(sources: Sequence[bytes]) -> str:
    import llvmlite.binding

    digest = hashlib.sha256()
    for word in (sys.version, version("numba"), llvmlite.binding.get_host_cpu_name()):
        digest.update(word.encode())
    for source in sources:
        digest.update(source)
    return digest.hexdigest()[:16]


def _folder(package: str) -> Path:
    return Path(__file__).parents[1] / package


def _stamp(package: str) -> Path:
    """The file that says what a package's kernels were compiled from: beside them, or in the user's cache."""
    folder = _folder(package)
    beside = folder / "__pycache__"
    if not os.access(beside if beside.exists() else folder, os.W_OK):
        beside = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "sightline" / package
    return beside / "kernels.json"
