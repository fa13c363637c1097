"""Before the first test: kernels are compiled, so that no test pays for it or runs a stale one; examples are seeded."""

from __future__ import annotations

import pytest
from hypothesis import settings

from launcher.kernels import warm_up

# The same examples every time; a new one that fails is printed with what is needed to run it again.
settings.register_profile("sightline", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("sightline")


def pytest_sessionstart(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    warm_up(reporter.write_line if reporter is not None else print)
