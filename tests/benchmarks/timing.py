"""What a benchmark case is made of."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeAlias

Work: TypeAlias = Callable[[], object]
"""What is timed. If it returns a float, that is the time that counts, in seconds: of a part of itself, or scaled up."""

Case: TypeAlias = tuple[Any, ...]
"""Name (str), target in seconds (float), work (`Work`); then any number of references, each a name (str) and a `Work`
or seconds (float) that were published.
"""


def seconds_of(work: Callable[..., object], *arguments: object) -> float:
    """How long a call takes that returns a float which is no time."""
    begin = time.perf_counter()
    work(*arguments)
    return time.perf_counter() - begin
