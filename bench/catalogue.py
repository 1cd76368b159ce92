"""What can be run, and on what: a literal table of procedures and what installed packages add to it, the rig files in `rigs/`,
the campaigns in `campaigns/`.

Nothing heavy is imported: `bench --help` and `bench list` read this. A test holds the table against the modules.
"""

from __future__ import annotations

import difflib
import importlib.util
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from bench import extensions
from bench.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Entry:
    """A procedure's name, the module that holds it as `procedure`, and what it does in one line; `point` is how a package
    registers one that is not ours."""

    name: str
    module: str
    about: str
    point: extensions.Point | None = None

    @property
    def owner(self) -> str:
        """Who brings it, for people: distribution and module."""
        return f"{extensions.OURS} ({self.module})" if self.point is None else self.point.owner


def _room(name: str, about: str) -> Entry:
    """A procedure of ours: its room is called as it is."""
    return Entry(name, f"procedures.{name.replace('-', '_')}.procedure", about)


PROCEDURES = (
    _room("amb-calibration", "AMB force-current constants by hanging known masses"),
    _room("force-constant", "Direct force constant of the motor, by the AMBs as load cells"),
    _room("negative-stiffness", "Negative stiffness of the motor by eccentric positioning"),
    _room("force-coupling", "Force coupling of the motor over the phase angle"),
    _room("torque-constant", "Torque constant of the motor by weights on a lever"),
    _room("spindown", "Drag of the levitated rotor by spindown"),
    _room("angle-step", "Angle step while the motor carries: static against priority currents"),
    _room("maximum-speed", "Maximum speed at the torque limit with two ways of sharing the segments"),
    _room("step", "Set-point steps of the levitated shaft, with two settings of the controller compared"),
    _room("load-balancing", "Active load balancing on a circle: the largest current with and without it"),
    _room("lift-off", "Phase angle from which on the motor lifts its end from the ring"),
    _room("slew", "Following a slow sine of the angle, with detent"),
    _room("bearing-model", "Force constants and magnetic offsets of the radial AMBs"),
    _room("tracking", "Following an ellipse with the centre of mass: PID, CCS and CAC"),
    _room("unbalance", "Unbalance response of the turning shaft: vectors, orbits, zones"),
    _room("compensation", "Compensation of unbalance: with and without it, and switched on"),
    _room("balance", "Two-plane balancing by influence coefficients from trial weights"),
    _room("run-up", "Run-up through the critical speeds: Bode, polar, waterfall, amplification"),
    _room("coast-down", "Coast-down through the critical speeds, analysed as a run-up"),
    _room("sensitivity", "Sensitivity of the control loops by injection, with zones and margins"),
    _room("loop-response", "Bandwidth and sensitivity of position loops, by sines into reference and reading"),
    _room("unstable-pole", "Pole of a shaft that magnets pull away, by holding its currents for some ms"),
    _room("pull-ratio", "Pull of magnets over the force constant, and where no current is needed, by set points"),
    _room("derivative", "Gain, error and band of an algebraic derivative, by injection"),
    _room("estimator-compare", "Velocity estimators in the loop: errors before, answers to a load"),
    _room("mission", "Lift, moves along and around at once, landing, on a linear-rotary machine"),
    _room("gate-margin", "What a levitation gate and the bearings' catch have to spare, over places and angles"),
    _room("actuator-constant", "Force and torque constants of a mover's motors, by sines into its loops"),
    _room("cogging-map", "Cogging of a mover along and around, by slow sweeps both ways"),
    _room("runout-map", "Runout of a levitated shaft's target and magnets, by slow turns"),
    _room("bearing-constant", "Force constants of radial actuators, by weights hung on the mover at two places"),
    _room("current-step", "Step response of the current loops: rise, bands, what goes across"),
    _room("encoder-zero", "Electrical zero of each motor against its encoder, by steps of the current along the field"),
    _room("sensor-delay", "How late positions are read, by their phase against the currents that push"),
    _room("emf-constant", "Flux and emf constants of a mover's motors, and what the nameplate's flux is meant of"),
    _room("map-zero", "Zeros of a reluctance machine's stators against its encoder, from both sides"),
    _room("inductance-map", "Map of a reluctance machine's inductances, by pulses at a locked rotor"),
    _room("static-characteristics", "Static torque and force of a reluctance machine's phases, by load cells"),
    _room("coil-map", "Coils, phases and actuators: is each where the controller takes it to be?"),
    _room("load-response", "Static compliance, friction, deviation and return of a positioned stage under known loads"),
    _room("positioning", "Repeatability and accuracy of positioning after ISO 230-2, by a reference instrument"),
    _room("step-following", "Steps of a positioned stage: static error, overshoot, settling"),
    _room("sine-following", "Sines that a positioned stage follows: errors, amplitude ratio, lag"),
    _room("axis-friction", "Friction of a stage's axes, alone and where both move, by known loads"),
    _room("axis-breakaway", "Breakaway of a stage's axes by slow ramps, alone and both at once, by known loads"),
    _room("axis-inertia", "Mass and moment of inertia of what a stage moves, by sines and a known part"),
    _room("decoupling", "Decoupling of a stage's axes: what a held one does, and what force crosses over to it"),
    _room("force-map", "Terms of the motor's force over displacement, currents and load"),
)


@dataclass(frozen=True, slots=True)
class RigEntry:
    """A rig file or campaign file that was found: its name is the file's stem."""

    name: str
    path: Path
    title: str


PACKAGED = Path(__file__).resolve().parent / "data"


def shipped(kind: str) -> Path:
    """The folder of the `rigs`, `specs` or `campaigns` that Levbench brings: in a clone beside the packages, and in one of
    them where it is installed, so that site-packages hold our packages alone."""
    inside = PACKAGED / kind
    return inside if inside.is_dir() else Path(__file__).resolve().parents[1] / kind


INSTALLED = shipped("rigs")
INSTALLED_CAMPAIGNS = shipped("campaigns")


def procedures() -> tuple[Entry, ...]:
    """Ours, then those of installed packages; what is taken twice is left out of these (`taken_twice` says so)."""
    ours = _ours()
    added = (p for p in extensions.points(extensions.PROCEDURES) if p.name not in ours)
    found = {p.name: _added(p) for p in added}
    twice = {name for name, _ in taken_twice()}
    return (*PROCEDURES, *(e for name, e in found.items() if name not in twice))


def taken_twice() -> tuple[tuple[str, str], ...]:
    """Names of procedures that have two owners, each with a sentence that names them."""
    return tuple(extensions.clashes(extensions.PROCEDURES, _ours()))


def _ours() -> dict[str, str]:
    return {p.name: p.module for p in PROCEDURES}


def _added(point: extensions.Point) -> Entry:
    return Entry(point.name, point.module, f"of the package {point.package} {point.version}", point)


def entry(name: str) -> Entry:
    """The line of a procedure, ours or an installed package's.

    Raises:
        ConfigError: there is no such procedure, or its name is taken twice.
    """
    ours = next((p for p in PROCEDURES if p.name == name), None)
    point = extensions.found(extensions.PROCEDURES, name, ours.module if ours else "")
    if ours is not None:
        return ours
    if point is None:
        raise ConfigError(_unknown("procedure", name, [p.name for p in procedures()]))
    return _added(point)


def of_file(path: Path) -> Entry | None:
    """The line of the procedure whose module a file is, if it is one's."""
    for candidate in procedures():
        where = file_of(candidate) if candidate.module.rpartition(".")[2] in (path.stem, path.parent.name) else None
        if where is not None and where.exists() and where.samefile(path):
            return candidate
    return None


def file_of(entry: Entry) -> Path | None:
    """The file of a procedure's module; of a package's, None where it cannot be found."""
    if entry.point is None:
        return INSTALLED.parent.joinpath(*entry.module.split(".")).with_suffix(".py")
    try:
        spec = importlib.util.find_spec(entry.module)  # imports the packages above it
    except (Exception, SystemExit):
        return None
    return Path(spec.origin) if spec is not None and spec.origin is not None else None


def rigs() -> Iterator[RigEntry]:
    """The rig files in `./rigs`, then those installed; a name in `./rigs` hides the installed one."""
    yield from _found(Path("rigs"), INSTALLED)


def campaigns() -> Iterator[RigEntry]:
    """The campaign files in `./campaigns`, then those installed; a name in `./campaigns` hides the installed one."""
    yield from _found(Path("campaigns"), INSTALLED_CAMPAIGNS)


def _found(*folders: Path) -> Iterator[RigEntry]:
    seen: set[str] = set()
    for folder in folders:
        for path in sorted(folder.glob("*.toml")):
            if path.stem not in seen:
                seen.add(path.stem)
                yield RigEntry(path.stem, path, _title(path))


def rig_path(rig: str) -> Path:
    """The file of a rig: `rig` is a path, else a name in `./rigs`, else a name in the installed `rigs/`.

    Raises:
        ConfigError: there is no such file.
    """
    return _path("rig", rig, (Path("rigs"), INSTALLED), rigs)


def campaign_path(campaign: str) -> Path:
    """The file of a campaign, found as rigs are, in `campaigns/`.

    Raises:
        ConfigError: there is no such file.
    """
    return _path("campaign", campaign, (Path("campaigns"), INSTALLED_CAMPAIGNS), campaigns)


def _path(kind: str, name: str, folders: tuple[Path, Path], known: Callable[[], Iterator[RigEntry]]) -> Path:
    if Path(name).is_file():
        return Path(name)
    for folder in folders:
        path = folder / f"{name.removesuffix('.toml')}.toml"
        if path.is_file():
            return path
    looked = f"(looked for a path, in ./{folders[0]} and in {folders[1]})"
    here = f"{name}.toml is a file: give it with its ending. " if Path(f"{name}.toml").is_file() else ""
    raise ConfigError(f"{here}{_unknown(kind, name, [r.name for r in known()])} {looked}")


def _unknown(kind: str, name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, 1)
    hint = f" Did you mean {close[0]}?" if close else ""
    return f"unknown {kind} {name!r}; expected one of: {', '.join(known) or '(none found)'}.{hint} Next: `bench list`"


def _title(path: Path) -> str:
    try:
        return str(tomllib.loads(path.read_text(encoding="utf-8")).get("title", ""))
    except (OSError, ValueError, RecursionError):
        return "(cannot be read; see `bench check`)"
