"""What a run leaves behind, and where: ``runs/<name>/``.

=================  =====================================================================
``scenario.toml``  the scenario as it was given
``mission.json``   the mission that every peer read (:class:`agents.mission.Mission`)
``map.json``       the map, whatever its format was, as polygons in metres
``versions.json``  of everything that took part
``recordings/``    one rerun file per process: ``<peer>.<incarnation>.rrd``
``logs/``          what the processes said, a file per peer
``promises/``      what each voter has promised, and must remember when it is started again
``bodies``         where each body stands (:mod:`agents.body_places`)
``links``          what the links lose on purpose (:mod:`protocol.link_faults`)
``control``        socket for ``sightline fault``, while the run lasts
``run.rrd``        the recordings in one file
``metrics.json``   the shares and counts
=================  =====================================================================

``runs/latest`` points to the youngest run.
"""

from __future__ import annotations

import contextlib
import json
import platform
import re
import shutil
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

import msgspec

from agents.mission import Mission
from launcher.scenario import ScenarioFault
from planning.environment import Environment

RUNS = Path("runs")
LATEST = "latest"
RECORDINGS = "recordings"
"""Folder of a run in which each process leaves its own file."""
_LIBRARIES = ("eclipse-zenoh", "rerun-sdk", "numpy", "scipy", "numba", "shapely", "networkx", "msgspec")


@dataclass(frozen=True)
class RunFolder:
    """The files of one run."""

    path: Path

    @property
    def mission_file(self) -> Path:
        """The mission."""
        return self.path / "mission.json"

    @property
    def recording(self) -> Path:
        """The merged recording."""
        return self.path / "run.rrd"

    @property
    def metrics_file(self) -> Path:
        """The metrics."""
        return self.path / "metrics.json"

    @classmethod
    def create(cls, name: str | None, team: str) -> RunFolder:
        """Make the folder of a new run in the present folder's ``runs``.

        Args:
            name: of the run; the team's name and the time of day if None.
            team: the team's name.

        Raises:
            ScenarioFault: the name cannot be a folder's, is taken, or the folder cannot be made.
        """
        if name is not None and (not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}", name) or name == LATEST):
            raise ScenarioFault(
                f"--name '{name}' cannot name a run; use letters, digits, '_', '-' and '.', not '{LATEST}'"
            )
        path = RUNS / (name or f"{team}-{datetime.now().astimezone():%Y%m%d-%H%M%S-%f}"[:-4])
        try:
            path.mkdir(parents=True)
        except FileExistsError as problem:
            raise ScenarioFault(f"{path} exists; choose another --name, or remove that run") from problem
        except OSError as problem:
            raise ScenarioFault(f"{path} cannot be made ({problem.strerror}); change to a folder you own") from problem
        return cls(path)

    @classmethod
    def find(cls, run: str | None) -> RunFolder:
        """Folder of a run that exists: a path, a name in ``runs``, or the latest if None.

        Raises:
            ScenarioFault: there is no such run.
        """
        if run in (None, LATEST, str(RUNS / LATEST)) and not (RUNS / LATEST).exists():
            raise ScenarioFault("there is no run in runs/: start one with `sightline run SCENARIO`, or name its folder")
        for path in (Path(run or LATEST), RUNS / (run or LATEST)):
            if (path / "mission.json").is_file():
                return cls(path)
        raise ScenarioFault(
            f"{run or RUNS / LATEST} is no run: name a folder that holds a mission.json, such as {RUNS / LATEST}"
        )

    def write(self, scenario_file: Path, mission: Mission, environment: Environment) -> None:
        """Write what the peers read and what explains the run later, and point ``latest`` here.

        Raises:
            ScenarioFault: that is not possible; the folder is removed again.
        """
        versions = {"sightline": version("sightline"), "python": platform.python_version()}
        versions |= {"platform": platform.platform()} | {library: version(library) for library in _LIBRARIES}
        try:
            (self.path / "scenario.toml").write_bytes(scenario_file.read_bytes())
            environment.save(self.path / mission.map_path)
            self.mission_file.write_bytes(msgspec.json.format(msgspec.json.encode(mission), indent=1))
            (self.path / "versions.json").write_text(json.dumps(versions, indent=1) + "\n", encoding="utf-8")
        except OSError as problem:
            shutil.rmtree(self.path, ignore_errors=True)
            raise ScenarioFault(
                f"{self.path} cannot be written ({problem.strerror}); make room, or change to another folder"
            ) from problem
        latest = RUNS / LATEST
        with contextlib.suppress(OSError):  # a convenience, and some file systems have no links
            latest.unlink(missing_ok=True)
            latest.symlink_to(self.path.name)

    def read_mission(self) -> Mission:
        """The run's mission.

        Raises:
            ScenarioFault: the file is not what the launcher wrote.
        """
        try:
            return msgspec.json.decode(self.mission_file.read_bytes(), type=Mission)
        except (OSError, msgspec.DecodeError) as problem:
            raise ScenarioFault(f"{self.mission_file} is no mission of this version: {problem}") from problem
