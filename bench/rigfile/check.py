"""What the types of a rig file cannot say: units that fit, geometry that exists, bindings that lead somewhere."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterator, Mapping

from bench import units
from bench.errors import ConfigError, Problem
from bench.rigfile import busload, check_protection, check_seen, linkurl
from bench.rigfile.beyond import beyond
from bench.rigfile.busload import BusLoad, bus_load
from bench.rigfile.check_binding import find, fits, signal_at
from bench.rigfile.check_binding import problems_of as problems_of_binding
from bench.rigfile.check_capabilities import problems_of as problems_of_capabilities
from bench.rigfile.check_capture import problems_of as problems_of_capture
from bench.rigfile.check_commandline import problems_of as problems_of_commandline
from bench.rigfile.check_machine import problems_of as problems_of_machine
from bench.rigfile.check_numbers import MACHINE
from bench.rigfile.check_numbers import problems_of as problems_of_numbers
from bench.rigfile.check_states import problems_of as problems_of_states
from bench.rigfile.messages import MessageMap
from bench.rigfile.model import LinkSpec, RigFile
from bench.rigfile.possible import impossible
from bench.rigfile.rest import follows, rest_of
from bench.rigfile.text import RigText, read_rig
from bench.units import Unit
from bench.wire import slcan


def check_rig(rig: str) -> tuple[tuple[Problem, ...], BusLoad | None]:
    """Every problem of a rig file at once, and the bus load when the DBC can be read.

    Raises:
        ConfigError: there is no such rig, or its files cannot be read at all.
    """
    text = read_rig(rig)
    try:
        loaded = RigFile.parse(text.toml, text.dbc, str(text.path))
    except ConfigError as error:
        if not error.problems:
            return text.told([Problem(str(text.path), "(file)", str(error), "a rig file")]), None
        return text.told([*error.problems, *_behind(text, error.problems)]), None
    load = None
    with contextlib.suppress(ConfigError, KeyError):
        load = bus_load(loaded.messages, loaded.link.bitrate, loaded.link.data_bitrate) if loaded.link.bitrate else None
    return text.told([*problems_of(loaded), *beyond(loaded)]), load


def _behind(text: RigText, problems: tuple[Problem, ...]) -> Iterator[Problem]:
    """What else is wrong with a file that breaks the types: the entries at fault are left out and the rest checked."""
    if (rest := rest_of(text, problems)) is None:
        return
    yield from (p for p in problems_of(rest) if not follows(p, problems))


def as_far_as_read(rig: str) -> RigFile | None:
    """A rig file, whatever is wrong with it: entries at fault are left out; None where nothing of it can be told.

    Raises:
        ConfigError: there is no such rig, or its files cannot be read at all.
    """
    text = read_rig(rig)
    try:
        return RigFile.parse(text.toml, text.dbc, str(text.path))
    except ConfigError as error:
        return rest_of(text, error.problems) if error.problems else None


def problems_of(rig: RigFile) -> list[Problem]:
    """What is wrong with a parsed rig file."""
    found = [
        *_devices(rig),
        *_links(rig),
        *_units(rig),
        *problems_of_numbers(rig),
        *_masses(rig),
        *check_protection.problems_of(rig),
        *_parameters(rig),
        *impossible(rig),
        *(Problem(rig.path, *line) for line in check_seen.problems_of(rig)),
        *((*problems_of_machine(rig), *problems_of_capabilities(rig)) if rig.written_in > 1 else ()),
    ]
    controller = rig.devices.get("controller")
    if controller is not None and controller.link in rig.links and rig.link.dbc:
        try:
            messages = rig.messages
        except ConfigError as error:
            why = str(error).removeprefix(f"{rig.link.dbc}: not a usable DBC: ")
            return [*found, Problem(rig.link.dbc, "(file)", why, "a usable DBC")]
        found += [*_bindings(rig, messages), *busload.problems_of(rig, messages)]
    return found


def _devices(rig: RigFile) -> Iterator[Problem]:
    if "controller" not in rig.devices:
        yield Problem(rig.path, "devices", ", ".join(rig.devices) or "nothing", "[devices.controller]")
    for name, device in rig.devices.items():
        if device.link not in rig.links:
            yield Problem(
                rig.path, f"devices.{name}.link", device.link, f"one of {', '.join(rig.links) or '(no links)'}"
            )
    controller = rig.devices.get("controller")
    if controller is not None and controller.link in rig.links and not rig.links[controller.link].dbc:
        yield Problem(rig.path, f"devices.controller.link: links.{controller.link}.dbc", "nothing", 'dbc = "FILE.dbc"')


def _schemes(rig: RigFile, device: str) -> tuple[str, ...]:
    """URL schemes that a device can be on: the controller, the operator's line, register devices."""
    if device == "controller":
        return linkurl.controller_schemes()
    return ("line",) if "operator" in rig.devices[device].roles else linkurl.device_schemes()


def _links(rig: RigFile) -> Iterator[Problem]:
    """URLs that can be taken apart, of a kind that their devices can have, with the bit rates that they need."""
    for name, link in rig.links.items():
        key = f"links.{name}"
        try:
            url = linkurl.parse(link.url)
            if url.scheme in linkurl.TCP_SCHEMES:
                _ = url.address
        except ConfigError as error:
            yield Problem(rig.path, f"{key}.url", repr(link.url), str(error))
            continue
        for device in (n for n, d in rig.devices.items() if d.link == name):
            fit = _schemes(rig, device)
            if url.scheme not in fit:
                such = ", ".join(linkurl.example(x) for x in fit)
                yield Problem(rig.path, f"{key}.url", link.url, f"a URL for the {device}, such as {such}")
        stated = link.bitrate is not None or "bitrate" in {**url.query, **link.options}
        if url.scheme in ("slcan", "can") and not stated:
            yield Problem(rig.path, f"{key}.bitrate", "nothing", "the bit rate of the CAN bus, bit/s")
        if url.scheme == "slcan":
            yield from _rates(rig, key, {**url.query, **link.options}, link)


def _rates(rig: RigFile, key: str, options: Mapping[str, object], link: LinkSpec) -> Iterator[Problem]:
    """Of SLCAN, which has a letter and a digit for some rates alone: an adapter would be asked for another one at the start."""
    fd = str(options.get("fd", True)).lower() not in ("false", "0")
    for name, codes in (("bitrate", slcan.BITRATES), ("data_bitrate", slcan.DATA_BITRATES if fd else {})):
        rate = getattr(link, name) or options.get(name)
        if rate is None or not codes:
            continue
        if str(rate).removesuffix(".0") not in {str(code) for code in codes}:
            expected = (
                f"a rate that SLCAN has: {', '.join(str(code) for code in codes)}; or another kind of adapter, can:..."
            )
            yield Problem(rig.path, f"{key}.{name}", f"{rate:.0f}" if isinstance(rate, float) else str(rate), expected)


def _units(rig: RigFile) -> Iterator[Problem]:
    named = {f"channels.{n}.unit": c.unit for n, c in rig.channels.items()}
    named |= {f"parameters.{n}.unit": p.unit for n, p in rig.parameters.items()}
    for key, symbol in named.items():
        if key.startswith("parameters.") and symbol in units.UNITS and not _is_si(units.UNITS[symbol]):
            yield Problem(
                rig.path, key, symbol, f"{units.UNITS[symbol].si}: default and range are in SI; the DBC may differ"
            )
        if symbol not in units.UNITS:
            yield Problem(rig.path, key, repr(symbol), units.expected(symbol))
    kinds = {f"geometry.{n}": (g, "N/m" if n.endswith("_stiffness") else "m") for n, g in rig.geometry.items()}
    kinds |= {f"masses.{n}": (m, "kg") for n, m in rig.masses.items()}
    kinds |= {f"machine.{n}": (m, MACHINE[n]) for n, m in rig.machine.items() if n in MACHINE}
    kinds |= {"hanger": (rig.hanger, "kg"), "mass_density": (rig.mass_density, "kg/m^3"),
              "site.gravity": (rig.site.gravity, "m/s^2"), "site.air_density": (rig.site.air_density, "kg/m^3")}  # fmt: skip
    for key, (toleranced, si) in kinds.items():
        if toleranced.unit != si:
            yield Problem(rig.path, f"{key}.unit", toleranced.unit, f"a unit of the kind of {si}")


def _is_si(unit: Unit) -> bool:
    return (unit.factor, unit.offset) == (1.0, 0.0)


def _masses(rig: RigFile) -> Iterator[Problem]:
    if not rig.masses:
        return
    for name, mass in {**rig.masses, "hanger": rig.hanger}.items():
        key = name if name == "hanger" else f"masses.{name}"
        if mass.value <= 0:
            yield Problem(rig.path, f"{key}.value", f"{mass.value:g} kg", "a positive mass")
        elif mass.value > rig.envelope.max_hung_kg:
            yield Problem(rig.path, f"{key}.value", f"{mass.value:g} kg",
                          f"at most envelope.max_hung_kg = {rig.envelope.max_hung_kg:g} kg")  # fmt: skip


def _parameters(rig: RigFile) -> Iterator[Problem]:
    taken: dict[int, str] = {}
    for name, p in rig.parameters.items():
        if p.low > p.high:
            yield Problem(rig.path, f"parameters.{name}", f"low {p.low:g} above high {p.high:g}", "low <= high")
        elif not p.low <= p.default <= p.high:
            yield Problem(rig.path, f"parameters.{name}.default", f"{p.default:g} {p.unit}", f"{p.low:g} to {p.high:g}")
        if (p.index is None) == (not p.signal):
            yield Problem(rig.path, f"parameters.{name}", "both or neither", "either index or signal")
        elif p.index is not None and p.index in taken:
            yield Problem(rig.path, f"parameters.{name}.index", str(p.index), f"an index of its own ({taken[p.index]})")
        if p.index is not None:
            taken.setdefault(p.index, name)


def _bindings(rig: RigFile, messages: MessageMap) -> Iterator[Problem]:
    yield from _bound_twice(rig)
    for name, channel in rig.channels.items():
        message, _, signal = channel.signal.partition(".")
        known = {s.name: s for s in messages.messages[message].signals} if message in messages.messages else {}
        if signal not in known:
            close = difflib.get_close_matches(signal, known, 1)
            yield Problem(rig.path, f"channels.{name}.signal", channel.signal,
                          f"a signal of {rig.link.dbc}" + (f", such as {message}.{close[0]}" if close else ""))  # fmt: skip
            continue
        dbc_unit = known[signal].unit
        if dbc_unit not in units.UNITS:
            yield Problem(rig.link.dbc, channel.signal, f"unit {dbc_unit!r}", units.expected(dbc_unit))
        elif channel.unit in units.UNITS and units.UNITS[dbc_unit].si != units.UNITS[channel.unit].si:
            yield Problem(rig.path, f"channels.{name}.unit", channel.unit, f"the kind of {dbc_unit} ({channel.signal})")
    yield from _signals_of_parameters(rig, messages)
    blocks = rig.link.url.partition(":")[0].lower() not in linkurl.PIECES_SCHEMES
    captures = problems_of_capture(rig.capture, messages, blocks=blocks) if rig.capture is not None else ()
    spoken = problems_of_commandline(rig, messages)
    for key, found, expected in (
        *problems_of_binding(rig, messages), *problems_of_states(rig, messages), *captures, *spoken,
        *check_seen.beyond_signals(rig, messages),
    ):  # fmt: skip
        yield Problem(rig.path, key, found, expected)


def _bound_twice(rig: RigFile) -> Iterator[Problem]:
    """A signal is one reading: as two channels it would pass for two sensors that agree."""
    taken: dict[str, str] = {}
    for name, channel in rig.channels.items():
        first = taken.setdefault(channel.signal, name)
        if first != name:
            found = f"{channel.signal}, which channels.{first} is bound to"
            yield Problem(
                rig.path, f"channels.{name}.signal", found, f"a signal of its own for {name}, or one of the two"
            )


def _signals_of_parameters(rig: RigFile, messages: MessageMap) -> Iterator[Problem]:
    """Parameters that are signals of the host's messages: they exist, in a unit of the kind, and can hold the range."""
    taken: dict[str, str] = {}
    for name, p in rig.parameters.items():
        if not p.signal:
            continue
        key = f"parameters.{name}.signal"
        if wrong := find(messages, p.signal):
            yield Problem(rig.path, key, wrong, f"a signal of {rig.link.dbc}")
            continue
        signal = signal_at(messages, p.signal)
        assert signal is not None
        if p.signal in taken:
            yield Problem(rig.path, key, p.signal, f"a signal of its own ({taken[p.signal]})")
        taken.setdefault(p.signal, name)
        unit = units.UNITS.get(signal.unit)
        if unit is None:
            yield Problem(rig.link.dbc, p.signal, f"unit {signal.unit!r}", units.expected(signal.unit))
        elif p.unit in units.UNITS and unit.si != units.UNITS[p.unit].si:
            yield Problem(rig.path, f"parameters.{name}.unit", p.unit, f"the kind of {signal.unit} ({p.signal})")
        elif not all(fits(signal, (x - unit.offset) / unit.factor) for x in (p.low, p.high, p.default)):
            yield Problem(
                rig.path, f"parameters.{name}", f"{p.low:g} to {p.high:g} {p.unit}", f"a range that {p.signal} can hold"
            )
