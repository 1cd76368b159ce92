"""What procedures do so that the motor carries the outboard end of the shaft in place of the outboard AMB, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bench.errors import RotorNotArrived
from bench.procedure.rig import Rig
from bench.rigfile import RigFile
from bench.rigfile.capabilities import is_bound as can
from bench.rigfile.places import Places
from procedures.servomotor import hold
from procedures.servomotor.parameters import stated, write

NEEDED = ("motor.share", "motor.share_slew", "motor.ref_across", "motor.ref_along", "at.yi", *hold.NEEDED)
SHAFT_N = 10.2 * 9.81  # T Table 6.1; of a shaft whose mass nobody told, for predictions before a run alone
ALPHA_D = 12.1  # N/A, T Table 6.2; of a motor that nobody has a model of, likewise
MARGIN = (
    0.8  # share of a current's limit that a prediction may use: force constants are within 10 %, the rest is control
)


def lacking(rig: RigFile) -> tuple[str, ...]:
    """What a controller lacks to let the motor carry the outboard end, force first."""
    needed = ("motor.share", "motor.share_slew", "settings.sharing.priority")
    return tuple(key for key in needed if not can(rig.capabilities, key))


def home(rig: Rig) -> None:
    """Turn the rotor to its home angle.

    Raises:
        RotorNotArrived: it does not arrive; the text names what an angle loop that runs away points to.
    """
    try:
        rig.rotation.point(0.0)
    except RotorNotArrived as error:
        why = "does the encoder count in the direction of the motor's torque, and is the shaft free?"
        raise RotorNotArrived(f"{error}; {why}") from error


def carry(rig: Rig, settle_s: float) -> None:
    """Hand the outboard end from the AMB to the motor, and wait until that has settled."""
    _hand_over(rig, 1.0, settle_s)


def give_back(rig: Rig, settle_s: float) -> None:
    """Hand the outboard end back to the AMB."""
    _hand_over(rig, 0.0, settle_s)


def _hand_over(rig: Rig, share: float, settle_s: float) -> None:
    write(rig, {"motor.share": share})
    rig.clock.sleep(1 / stated(rig.file, "motor.share_slew").default + settle_s)


def to_edge(rig: Rig, side: int, count_rad: float) -> None:
    """Keep the rotor at an edge of the encoder's count that reads zero, the upper (+1) or the lower one (-1).

    The ripple (T 5.25, terms 2 and 3) turns the motor's force with P theta, P = 2 M: against F_x = alpha_3 sin(P theta) i_y
    the controller sets i_x. With gravity's i_y of 4 A, alpha_3/alpha_d = 2.5 % and a count of 1.5 mrad, a rotor that goes
    from one count to the next shifts i_x by 16 * 1.5e-3 * 2.5 % * 4 A = 2.5 mA, as much as a sensor that drifts.

    And so it goes at home: the rotor rests at whichever edge suits the torque of unequal segments and what its last move
    has left in the angle's integrator, and a current that changes takes it to another. Here it is taken up anew, without
    the integrator: readings of one count and the next give kp_theta times half a count, 38 mA, either way, and the mean
    between them is the torque current that is needed (up to 25 mA with segments within 1 %), whatever was before.
    """
    hold.release(rig)
    write(rig, {"angle.ref": side * count_rad / 2})
    hold.hold(rig, ki_theta=0.0)


def leave_edge(rig: Rig) -> None:
    """Back to the middle of the count, with the integrator."""
    write(rig, {"angle.ref": 0.0})
    hold.hold(rig)


def mirrored(levels: Sequence[float]) -> Iterator[tuple[float, int]]:
    """Levels up and down with their branch (+1 reached from below): drift that is linear in time cancels."""
    yield levels[0], -1
    yield from ((x, 1) for x in levels[1:])
    yield from ((x, -1) for x in reversed(levels[:-1]))


def approach(levels: Sequence[float]) -> list[float]:
    """Where to go first, unrecorded, from zero to the lowest level, so that it is reached from above like in the end."""
    return sorted((x for x in levels if x < 0), reverse=True)[:-1]


def told_weight_N(rig: RigFile) -> float | None:
    """The shaft's weight, N, by the mass that the rig file tells; None where it tells none."""
    if rig.shaft is None or rig.shaft.mass is None:
        return None
    return Places(rig).number(rig.shaft.mass, "shaft.mass").number.value * rig.site.gravity.value


def weight_N(rig: RigFile) -> float:
    """The shaft's weight for predictions, N."""
    return told_weight_N(rig) or SHAFT_N


def lever(rig: RigFile) -> float:
    """Share of the weight that the motor carries: moments about the inboard AMB."""
    arm = rig.geometry["com_to_inboard_amb"].value
    return arm / (arm + rig.geometry["com_to_motor"].value)


def gravity_share_N(rig: RigFile) -> float:
    """What the motor carries, for predictions, N."""
    return weight_N(rig) * lever(rig)


def newtons_per_A(rig: RigFile) -> float:
    """The motor's force constant, for predictions: what the controller takes it for, where it has a model of the motor."""
    told = rig.capabilities.model.get("alpha_d")
    return rig.parameters[told].default if told else ALPHA_D
