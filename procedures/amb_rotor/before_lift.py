"""What a procedure that begins with the shaft held looks at before: how it lies on its rings, and what its lift shows.

The readings are the newest ones that came while the controller got ready: nothing waits, nobody is asked, and the recording has
no step more. What forbids the lift, or explains why it failed, is put into the recording as it was found.
"""

from __future__ import annotations

from bench.errors import DeviceFault, Lacking
from bench.findings import Finding
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import rings
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.shared import first_look


def lifted(rig: Rig, record: Recorder) -> bool:
    """Lift the shaft from its rings; False where they show that it must not be, or where it was lost: the analysis tells."""
    machine = _lying(rig.file)
    if machine is None:
        transition(rig, RigState.LEVITATED)
        return True
    readings = {name: rig.levitation.reading(name) for name in machine.stations.channels}
    found = list(rings.of_readings(readings, rig.file)) or list(_lost(rig, record, machine))
    if found:
        first_look.ends(record, found)
    return not found


def _lying(rig: RigFile) -> AmbRotor | None:
    """A machine whose shaft lies where its weight has it; none of another kind, nor one with a motor whose magnets draw the
    shaft to a side of its rings that no rig file tells."""
    try:
        machine = conventions(rig)
    except Lacking:
        return None
    return None if machine.stations.helpers else machine


def _lost(rig: Rig, record: Recorder, machine: AmbRotor) -> list[Finding]:
    """Lift it; what explains a lift that failed."""
    begun = rig.clock.now_ns()
    with record.watching((*machine.positions, *machine.currents)) as seen:
        try:
            transition(rig, RigState.LEVITATED)
        except DeviceFault as error:
            fault = str(error)
        else:
            return []
    count = max((len(x) for x in seen.values()), default=1)
    return [rings.of_lift(seen, (rig.clock.now_ns() - begun) * 1e-9 / count, fault, rig.file)]
