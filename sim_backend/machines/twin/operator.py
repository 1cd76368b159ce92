"""Who works on a twin: hangs masses on its hooks, fixes weights in its balancing planes, turns its shaft by hand, each with the
errors that the rig file states."""

from __future__ import annotations

import math

from bench.rigfile import RigFile
from bench.rigfile.elements import BalancingPlane, Hook
from sim_backend.draws import draw_one
from sim_backend.machine import Truth
from sim_backend.machines.twin.columns import Columns
from sim_backend.machines.twin.layout import Geometry, layout_of
from sim_backend.machines.twin.nominal import nominal_of
from sim_backend.machines.twin.plant import TwinPlant
from sim_backend.machines.twin.rules import drawn
from sim_backend.operator_line import words

WORK_S = 1.0
HAND_OVER_S = 0.3  # how long it takes to let a mass go
RING = "machine.ring_inertia"


class Fitter:
    """Planted defects: `weight_lost`, what is fixed falls off; the number of the weight that goes into the next plane
    (`weight_astray`), that is turned by `weight_turned_rad` (`weight_turned`), that is heavier by the share `weight_heavy_by`
    (`weight_heavy`); `loose_weight`, an unbalance in kg m that somebody left in the first plane; `mass_error_LABEL`."""

    def __init__(self, rig: RigFile, plant: TwinPlant, truth: Truth) -> None:
        self._rig, self._plant, self._truth = rig, plant, truth
        self._geometry = Geometry(rig, layout_of(rig), truth.values)
        self._columns = Columns(self._geometry, nominal_of(rig), truth.values)
        self._fixed = self._hung = self._turned = 0
        self._hanging = (0.0,) * 9
        if truth.defects.get("loose_weight"):
            plant.weights(0, truth.defects["loose_weight"], 0.0)

    def request(self, line: str) -> str:
        """One line: `hang M2`, `hang -`, `hang HOOK M2`, `attach PLANE KG RAD` (on the plane's scale), `detach PLANE`,
        `turn DEG` (the mark so far on from where it is told, as the speed counts), `push DEG` (the shaft aside, as the rig
        file's directions count), `push -` (let go), `mount ring`, `mount -`, `ask TEXT`.
        Answers `ok SECONDS` (when it is done), `yes` or `error TEXT`."""
        hooks, planes = self._rig.hooks, list(self._rig.balancing)
        match words(line, self._rig.masses):
            case ["ask", *_]:
                return "yes"
            case ["hang", label] if hooks and self._knows(label):
                self._hang(next(iter(hooks)), label)
                return f"ok {HAND_OVER_S}"
            case ["hang", hook, label] if hook in hooks and self._knows(label):
                self._hang(hook, label)
                return f"ok {HAND_OVER_S}"
            case ["attach", plane, mass, angle] if plane in planes and _numbers(mass, angle) and float(mass) > 0:
                self._attach(planes.index(plane), float(mass), float(angle))
            case ["detach", plane] if plane in planes:
                self._plant.without_weights(planes.index(plane))
            case ["turn", angle] if _numbers(angle) and abs(self._plant.shaft_speed) < 0.1:
                self._turn(math.radians(float(angle)))
            case ["push", "-"]:
                self._plant.load(self._hanging, HAND_OVER_S)
            case ["push", angle] if _numbers(angle) and abs(self._plant.shaft_speed) < 0.1:
                self._push(layout_of(self._rig).sense * math.radians(float(angle)))
            case ["mount", "ring" | "-" as part] if RING in self._truth.values:
                self._plant.mount(self._truth.values[RING] if part == "ring" else 0.0)
            case _:
                return f"error cannot {line.strip()!r}"
        return f"ok {WORK_S}"

    def _knows(self, label: str) -> bool:
        return label == "-" or f"masses.{label}" in self._truth.values

    def _drawn(self, name: str, what: str, count: int) -> float:
        if name in self._truth.told:
            return self._truth.values[name]
        return draw_one(
            drawn(self._rig)[name], self._truth.seed, self._truth.anew(f"{what}:{count}"), self._truth.visit
        )

    def _hang(self, name: str, label: str) -> None:
        """Down, or by a pulley: what friction leaves of the weight, and not quite in the direction that the file says."""
        _, newtons = self._truth.load("" if label == "-" else label)
        self._hung += 1
        hook, g = self._rig.hooks[name], self._geometry
        station = g.station(f"hooks/{name}") + self._drawn("hook_seat", "seat", self._hung)
        if hook.pull is None:
            tilt = math.asin(max(-1.0, min(1.0, -self._plant.params.gravity[0] / self._truth.values["site.gravity"])))
            along, angle, across = -newtons * math.sin(tilt), math.pi, newtons * math.cos(tilt)
        else:
            kept, off = self._pulley(hook, name)
            along, angle, across = 0.0, g.angle(f"hooks/{name}") + off, newtons * kept
        fy, fz = across * math.cos(angle), across * math.sin(angle)
        one, two = self._columns.shape(station)
        self._hanging = (along, fy, fz, -station * fz, station * fy, one * fy, one * fz, two * fy, two * fz)
        self._plant.load(self._hanging, HAND_OVER_S)

    def _push(self, angle: float) -> None:
        """By hand, midway between the rings, with as much as the shaft weighs, beside what hangs."""
        newtons = self._plant.params.mass * self._truth.values["site.gravity"]
        at = [self._geometry.station(ring.part) for ring in layout_of(self._rig).rings]
        station, fy, fz = (min(at) + max(at)) / 2, newtons * math.cos(angle), newtons * math.sin(angle)
        one, two = self._columns.shape(station)
        push = (0.0, fy, fz, -station * fz, station * fy, one * fy, one * fz, two * fy, two * fz)
        self._plant.load(tuple(a + b for a, b in zip(self._hanging, push, strict=True)), HAND_OVER_S)

    def _pulley(self, hook: Hook, name: str) -> tuple[float, float]:
        """What share of the weight it hands on, and by how much it is off, rad."""
        if hook.pulley is None:
            return 1.0, 0.0
        key, g = f"hooks.{name}.pulley", self._geometry
        return 1 - g.number(hook.pulley.friction, f"{key}.friction"), g.number(
            hook.pulley.misalignment, f"{key}.misalignment"
        )

    def _attach(self, k: int, mass: float, angle: float) -> None:
        self._fixed += 1
        names, defects = list(self._rig.balancing), self._truth.defects
        if self._fixed == defects["weight_astray"]:
            k = (k + 1) % len(names)
        if self._fixed == defects["weight_turned"]:
            angle += defects["weight_turned_rad"]
        if self._fixed == defects["weight_heavy"]:
            mass *= 1 + defects["weight_heavy_by"]
        plane, g = self._rig.balancing[names[k]], self._geometry
        zero = 0.0 if plane.zero is None else g.number(plane.zero, f"balancing.{names[k]}.zero")
        heavier, turned = self._errors(names[k], plane)
        at = zero + plane.sense * (angle + turned)  # in the direction of rotation, whichever it is
        radius = g.number(plane.radius, f"balancing.{names[k]}.radius")
        if not defects["weight_lost"]:
            self._plant.weights(k, (mass + heavier) * radius, at)

    def _errors(self, plane_name: str, plane: BalancingPlane) -> tuple[float, float]:
        """Of one weight: kg and rad, each weight by itself."""
        out = []
        for k, key in enumerate(("weight_mass", "weight_angle")):
            stated = getattr(plane, key)
            name = f"balancing.{plane_name}.{key}"
            found = None if stated is None else self._geometry.places.number(stated, name)
            if name in self._truth.told:
                draw = self._truth.values[name]
            elif found is None:
                draw = 0.0
            else:
                count = self._truth.anew(f"weight:{k}:{self._fixed}")
                draw = draw_one(found.number, self._truth.seed, count, self._truth.visit)
            out.append(draw)
        return out[0], out[1]

    def _turn(self, angle: float) -> None:
        self._turned += 1
        self._plant.turn(angle + self._drawn("hand_angle", "turn", self._turned))


def _numbers(*words: str) -> bool:
    try:
        return all(math.isfinite(float(word)) for word in words)
    except ValueError:
        return False
