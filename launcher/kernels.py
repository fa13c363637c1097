"""Compiling the numerical kernels once, before a team of processes needs them all at the same time.

numba keeps compiled kernels beside the source or, where that is read-only, in the user's cache folder. It takes a kept
kernel to be fresh while the kernel's *own* file is unchanged, although a kernel contains the code of those that it
calls. So a stamp says what was compiled together: for each module with kernels a digest of its source, of all that it
imports from its package, of the versions and of the processor. The kept kernels of a module with another digest are
thrown away before they can be used.

It takes minutes of processor time, so each part of a package's ``warm_up`` has a process of its own, as many at a time
as there are processors. Who comes while others compile waits for them.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

PACKAGES: tuple[str, ...] = ("planning", "estimation")
"""Packages with kernels; each has a module ``warm_up`` whose ``PARTS``, functions, run them all."""


class CompilationFailed(RuntimeError):
    """A kernel did not compile or failed at its first run; the text is what the process said."""


def warm_up(announce: Callable[[str], None] = lambda _: None, packages: Sequence[str] = ()) -> bool:
    """Compile every kernel unless that has been done; say so through ``announce`` beforehand.

    To be called before the first kernel of the process: what it has loaded it keeps.

    Args:
        announce: is told before anything that takes long.
        packages: those that are needed; all if empty.

    Returns:
        Whether anything had to be compiled.

    Raises:
        CompilationFailed: it cannot be done.
    """
    wanted = [package for package in packages or PACKAGES if _stale_modules(package)]
    if not wanted:
        return False
    announce("Compiling the numerical kernels (once for this version; some minutes) ...")
    with ExitStack() as alone:
        for package in sorted(wanted):
            alone.enter_context(_lock(_stamp(package).with_suffix(".lock")))
        stale = {package: modules for package in wanted if (modules := _stale_modules(package))}
        _compile(stale)
    return bool(stale)


def compile_part(package: str, number: int) -> None:
    """Run one part of a package's warm-up while other processes run others.

    numba keeps the versions of a kernel in an index that it reads, changes and writes: here one process after another.
    """
    from numba.core.caching import IndexDataCacheFile

    save, turn = IndexDataCacheFile.save, _stamp(package).with_suffix(".turn")

    def save_in_turn(file: IndexDataCacheFile, key: object, data: object) -> None:
        with _lock(turn):
            save(file, key, data)

    IndexDataCacheFile.save = save_in_turn
    import_module(f"{package}.warm_up").PARTS[number]()


def _compile(stale: Mapping[str, Sequence[str]]) -> None:
    """Compile packages of which these modules are stale."""
    digests = {package: _digests(package) for package in stale}
    parts = []
    for package, modules in stale.items():
        kept = _stamp(package).parent
        for module in modules:
            for file in (*kept.glob(f"{module}.*.nbi"), *kept.glob(f"{module}.*.nbc")):
                file.unlink(missing_ok=True)
        parts += [(package, number) for number in range(len(import_module(f"{package}.warm_up").PARTS))]
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as processors:
        for failure in processors.map(_start_part, parts):
            if failure:
                raise CompilationFailed(failure)
    for package in stale:
        # Whole or not at all: others read it without the lock.
        stamp = _stamp(package)
        fresh = stamp.with_suffix(f".{os.getpid()}")
        fresh.write_text(json.dumps(digests[package], indent=0), encoding="utf-8")
        fresh.replace(stamp)


def _start_part(part: tuple[str, int]) -> str:
    """Compile a part in a process of its own; what it said if it failed."""
    package, number = part
    code = f"from launcher.kernels import compile_part; compile_part({package!r}, {number})"
    paths = os.pathsep.join(path or "." for path in sys.path)
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if done.returncode == 0 else f"the kernels of {package} do not compile:\n{done.stderr}"


@contextmanager
def _lock(path: Path) -> Iterator[None]:
    """Wait until no other process is within the lock of this name. The system opens it when a process dies."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


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


def _imports(package: str, source: bytes) -> set[str]:
    """Modules of the package that a source imports anywhere: by its text, as every command asks when it starts."""
    return {
        module.decode() for module in re.findall(rb"^[ \t]*from %s\.(\w+)" % package.encode(), source, re.MULTILINE)
    }


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
