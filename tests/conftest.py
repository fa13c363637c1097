"""Kernels are compiled before the first test, so that no test's time limit pays for it and none runs a stale one."""

from __future__ import annotations

import pytest

from planning.warm_up import warm_up


def pytest_sessionstart(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    warm_up(reporter.write_line if reporter is not None else print)
