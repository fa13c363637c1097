"""Before the first test: kernels are compiled, so that no test pays for it or runs a stale one; examples are seeded.

Compiled maps are kept in a folder of the session's own, which its processes share: nothing of the user's is read or
written.
"""

from __future__ import annotations

import os
import tempfile

import pytest
from hypothesis import settings

from launcher.kernels import warm_up

# The same examples every time; a new one that fails is printed with what is needed to run it again.
settings.register_profile("sightline", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("sightline")


def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput"):  # one of several processes of the session, which inherits the folder
        return
    folder = tempfile.TemporaryDirectory(prefix="sightline-maps-")
    os.environ["SIGHTLINE_CACHE"] = folder.name
    config.add_cleanup(folder.cleanup)


def pytest_sessionstart(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    warm_up(reporter.write_line if reporter is not None else print)
