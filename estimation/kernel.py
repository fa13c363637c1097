"""How numeric kernels are compiled: by numba, once, kept on disk, free of the interpreter's lock, never fast-math."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function at its first call, and keep its declared type, which numba's own decorator loses."""
    compiled: _Function = njit(cache=True, nogil=True)(function)
    return compiled
