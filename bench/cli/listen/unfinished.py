"""A rig file to listen with: it may be unfinished, as long as what listening needs is there."""

from __future__ import annotations

from bench import catalogue
from bench.errors import ConfigError, Problem
from bench.rigfile import RigFile
from bench.rigfile.check import as_far_as_read, check_rig

NEEDED = ("links", "channels", "devices.controller")
CONTROLLER = "devices.controller.binding"
UNHEARD = tuple(f"{CONTROLLER}.{key}" for key in ("commands", "states", "no_fault", "heartbeat", "heartbeat_counter"))
"""What is said to the controller, or what its words mean: the listener does without."""


def listenable(rig: str) -> tuple[RigFile, int]:
    """The rig file, and how many problems `bench check` has with what listening does without: certificates, limits, commands.

    Raises:
        ConfigError: there is no such rig, or links, channels or the telemetry's binding have problems; all of these are in it.
    """
    problems, _ = check_rig(rig)
    file = as_far_as_read(rig)
    if file is None or "controller" not in file.devices or file.devices["controller"].link not in file.links:
        raise ConfigError(f"rig file {catalogue.rig_path(rig)} cannot be used:", problems)
    if hindering := tuple(p for p in problems if _hinders(file, p)):
        raise ConfigError(f"rig file {file.path}: what listening needs has problems:", hindering)
    return file, len(problems)


def _hinders(file: RigFile, problem: Problem) -> bool:
    """Whether a problem is about the controller's link, its telemetry or the channels."""
    key, link = problem.key, file.devices["controller"].link
    if problem.file == file.link.dbc:
        message = key.removeprefix("BO_ ").partition(".")[0]
        return key == "(file)" or message in file.binding.telemetry
    if key.startswith("links."):
        return (key == f"links.{link}" or key.startswith(f"links.{link}.")) and "bus load" not in problem.found
    within = any(key == table or key.startswith(f"{table}.") for table in (*NEEDED, "(file)"))
    return within and not any(key == part or key.startswith(f"{part}.") for part in UNHEARD)
