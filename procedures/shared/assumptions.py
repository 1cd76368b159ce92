"""What is in no budget and no data of any size can show, by procedure: sentences for the report, each with its sensitivity."""

from __future__ import annotations

AMB_CALIBRATION = (
    "An error that is common to all masses, the same share of each, changes K, K_2 and K_w by that share.",
    "Errors of the masses that go with the square of the load change K_2 by K² over the bearing's force per kg, for each kg "
    "per kg². Masses of 1, 2 and 3 kg off by 0.2, 0.4 and 0.6 % leave the data that one of 0.5 kg off by -0.1 % leaves.",
    "A hanger that is off throughout changes F_0, and K_w by 2 K_2/K_w for each N that it weighs at the bearing.",
    "Coil current sensors whose readings bend over the current; certificates state gain and offset only. If the positive one "
    "of a bearing reads 12 mA too much at 3 A to either side of the bias (0.1 % of 12 A, growing with the square) and the "
    "negative one as much too little, K_2 changes by -K/750 A and K_w by -K/375 A for each ampere of control current that "
    "carries the rotor: 0.1 N/A² and 0.2 N/A where K is 75 N/A.",
    "Bent both the same way by as much, they change K_2 outboard by up to 0.2 N/A² and K outboard by 0.4 N/A; readings 12 mA "
    "too high at 3 A that go with the cube of the current change K by -1.6 % and K_2 outboard by -0.7 N/A². 36 mA of the "
    "latter are found. Ask for the sensors' linearity, or compare them with a reference at five currents.",
)
TORQUE_CONSTANT = (
    "An error that is common to all masses or to both arms, the same share of each, changes alpha_tau by that share.",
    "A lever that is not level by 1° takes 0.015 % off every torque, and off alpha_tau.",
)
BEARING_MODEL = (
    "An error of the shaft's mass, whose weight is the known force, changes β, K_i and K_x by its share.",
    "An axis that is reversed as a whole, coils, probe and gravity, is the same machine seen from below: only the sign of its "
    "offset differs.",
    "A coupling that turns the shaft, besides its spring's pull: a moment of 1 N mm changes the force of either AMB by 5.6 mN, "
    "0.2 % of its load, and β by that share.",
)
PASSAGE = (
    "Runout that changes with the speed or the temperature: 1 µm of it is 1 µm in every vector.",
    "The mark of the once-per-turn pulse: phases count from where it is taken to be; 1° turns every vector by 1°, 1.7 % of it.",
    "A weight that slips or a machine that warms on the way: what is measured after it is another machine's than what was "
    "measured before. A run-up and a coast-down beside each other show it.",
)
SENSITIVITY = (
    "The loop of another day: an open loop whose gain is 1 % greater, as by the temperature of amplifiers and probes, changes "
    "S by (S - 1) of 1 %, up to 4 % of itself where it is 3.",
    "A bending mode that the plan does not name and that is damped a quarter as much as its mode_damping or less may be missed "
    "by the scan: the gain may rise less than is told, 2.5 times where 5 was told.",
)
LOOP_RESPONSE = (
    "The loop of another place: along the shaft the planes' levers change, and with them what one plane's loop moves. Of a "
    "mover of 1.34 kg between planes 45 mm off its middle, 1 mm changes the bandwidth of a radial loop by 3 to 4 %.",
    "The loop of another day: actuators whose constant is 1 % greater change a bandwidth by about 1 %.",
    "A resonance narrower than an octave, which is how far apart lines may be: one that is damped by 0.1 and raises |S| to 3 "
    "raises it to 1.3 at a line 40 % beside it, and S_max is read elsewhere.",
)
SPINDOWN = (
    "A constant torque that acts against either direction alike, such as a seal or a brake that drags whatever turns the "
    "rotor, is in T_c with its whole amount.",
    "A drag of the drive that acts only while the rotor coasts is in T_c with what it is more or less than stated; it is seen "
    "from some 4 mN m beyond the stated range on.",
    "With the ring an error of its inertia changes J_z, B and T_c by its share, until J_z leaves the drawing's tolerance.",
)
FORCE_CONSTANT = (
    "Current sensors of both AMBs whose gains changed since the calibration, each by its own share, look like probes whose "
    "zeros moved: 0.3 % of the upper outboard coil's changes alpha_d by 0.7 %. One that changed alone is found by the load.",
    "Segment current sensors whose readings bend: 12 mA too high at 3 A, growing with the cube of the current, change alpha_d "
    "by -0.2 %. Coil current sensors that bend as they did in the AMBs' calibration hardly count: its constants fit their "
    "readings.",
    "An asymmetry K_x/K_y that is common to both AMBs changes alpha_dx by the same share: both rows move together.",
)
FORCE_COUPLING = (
    "A controller that turns its currents by 1 % more than the phase angle it was told changes the ratio by -0.7 %, alpha_c by "
    "0.7 % and gamma_0 by 0.02°. The current sensors' offsets hide as much; about 1.2 % are found.",
    "Segment current sensors whose readings bend; certificates state gain and offset only. 6 mA too high at 3 A, growing with "
    "the cube of the current, change alpha_ratio by -0.1 to -0.3 %; about 12 mA (0.1 % of 12 A) are found. 12 mA that grow "
    "with the square, up on one segment of a pair and down on the other, change it by -0.2 % and gamma_0 by 0.02°; 24 mA are "
    "found.",
)
FORCE_MAP = (
    "A coil's current sensor of the inboard AMB whose gain changed since its calibration changes alpha_1 and alpha_5 by that "
    "share.",
)
ESTIMATOR_COMPARE = (
    "An estimate of the disturbance that is wrong by a constant, or by a sine of the exciter's own frequency, is not seen in "
    "disturbance_error: 5 % of the force constant in the controller's model is 0.1 N of 2 N.",
    "The load comes on as it does in every repeat; a weight that swings on its thread moves peak and integral of all alike.",
)
DERIVATIVE = (
    "The captured position is the one that the law took, and the velocity the one of the same tick: a tick between them turns "
    "the phase by 0.036° per Hz.",
    "Time is the controller's: a clock that is fast by 1e-4 changes gains and errors by that share, and the frequencies of "
    "lines and edges by as much.",
)
SLEW = (
    "A controller whose reference swings by another amplitude than it was told changes the amplitude ratio by that share, and "
    "the errors of tracking by as much of the amplitude. It is found beyond the error that the torque current allows at the "
    "slowest frequency, some 0.2 %.",
)
LIFT_OFF = (
    "Segment current sensors whose readings bend: what is 1 % more at 10 A than at 4 A changes the prediction by 0.1° at 2.5°, "
    "and more where the angle is smaller; the angle that is measured stays.",
    "A load that changes between the ring and the hold, such as a weight that is lifted off with the shaft.",
    "A weight that hung on the shaft in force-coupling already, and hangs there still: 0.1 kg on the hook makes the angle 0.1° "
    "larger at 2.5°, 0.3° at 1.1°. Where the rig file tells the shaft's mass it is found from a quarter of its weight on.",
    "What changes between force-coupling and this run by less than is looked for: 10 g on the hook moves the angle by 0.01° at "
    "2.5°, by 0.03° at 1.1°, and by several of its uncertainties on a machine that nearly lifts at 0; 5 mA of the limit of the "
    "segments moves it as 6 g do.",
)
MAXIMUM_SPEED = (
    "Time is the controller's: a clock that is fast by 1e-4 makes both speeds slower by that share, and B greater.",
    "The drag at speed is that of the spindown: heat or a seal that changes B by 1 % since changes the expected speeds by 1 %, "
    "and hides below the inertia's tolerance; the ratio does not know it.",
    "What the segments carry within a tick, such as the amplifiers' switching, is not seen.",
)
ANGLE_STEP = (
    "A reference that the controller scales is measured as the step that it makes: 1 % of it is 1 % of the step in final_error "
    "and overshoot, and moves settling_time by as long as the angle takes for it. Either end of a step is known to a count of "
    "the encoder, 1.5 % of 12° together; a scale of 3 % is found.",
    "A controller with other gains of the angle than the plan's, or with another torque constant, gives another response: it "
    "is what was measured, and no finding.",
    "A position sensor whose gain is off by more than its certificate says: 1 % of it is up to 1 % in peak and excess, where "
    "the shaft moves along it. The loop holds the shaft by that sensor, and no other sees it.",
)
STEP = (
    "A set point that the controller scales is measured as the step that it makes: 1 % of it is 1 % of the step in "
    "steady_error, 1.5 % in overshoot, and half a swing or more in settling_time.",
    "A controller that goes to its set points at a rate of its own makes ramps of them: found where the largest step rises "
    "later than the smallest by 1 % and 1.5 U of the difference; less widens a rise by as much.",
    "A sample of telemetry is taken for the mean over its period, also where binding.samples says otherwise. Where it is a "
    "reading at the period's end, overshoots come too large: by 0.4 % of the swing where a twentieth of the swing's period "
    "passes between samples, by its square elsewhere.",
)
UNBALANCE = (
    "Runout that changes with speed (a shaft that grows, probes that see its material) is in the vectors, half axes and D_max "
    "with its whole amount: the slow roll sees it at its own speed only.",
    "Motion that turns with the shaft at order 4 or above is taken for runout: D_max may lack its whole amount.",
)
BALANCE = (
    "Both trial weights at the same wrong angle turn the unbalance by it: corrections by that scale are right all the same.",
    "A laboratory balance that weighs every weight wrong by one share changes the unbalance by that share; corrections that "
    "are weighed on it are right all the same.",
    "Runout that changes with speed reads as unbalance: 2 µm at 10 000 r/min as some 1 g mm, as found and as left.",
)
LOAD_BALANCING = (
    "Segment current sensors whose readings bend: 0.1 % of 10 A at 7 A and nothing at 5 A changes the reduction by 0.1 points.",
    "A segment's current sensor whose gain has changed since its certificate: the segment gives another force for what it "
    "reads, as segments do that differ. 1 % of one of four is 0.5 % of the peaks, 0.002 of unbalance after balancing and "
    "0.004 of its ratio; the reduction stays.",
    "A position sensor whose gain has changed since the calibrations: 1 % of it is up to 10 nm of error_radius before "
    "balancing and 0.2 nm after, and no current. 10 % is found.",
)
MISSION = (
    "Readings are not the shaft's axis: integrators bring each reading back to zero, and a target that is not round moves the "
    "axis instead, by as much as it is out of round, 25 µm for 20 µm of runout at both places together. No probe here sees it; "
    "level_difference is of readings.",
    "Distances count from each probe's own zero, not from the middle of the rings: a zero that is 5 µm off brings the mover "
    "5 µm nearer to one side and changes no result.",
    "What happens while a capture is uploaded, the mover held where it is, is in no result.",
)
CURRENT_STEP = (
    "Currents are as the controller's own sensors read them. One gain for all of them cancels in every quantity; gains that "
    "differ by 0.5 % between two coils turn 0.1 % of the step across.",
    "Time is the controller's: a clock that is fast by 1e-4 makes rise times shorter and bands wider by that share.",
    "Phases that are exchanged alike in the winding and in the controller's count, or an encoder whose zero is off: at "
    "standstill the currents are the same to the last digit. The order of the phases and the zeros are other tests'.",
    "A coil of the linear winding that is reversed and stands where its current gives no force: it pushes nothing there.",
)
UNSTABLE_POLE = (
    "Magnets that pull by more than in proportion to the way: shots of 15 µm tell a mean over them. A pull that is 1 % "
    "stiffer at 20 µm than at the middle changes the pole by about 0.3 %.",
    "Another place along the shaft: the pole is that of planes which pull as they do where it was measured.",
)
ACTUATOR_CONSTANT = (
    "What is moved is the mass, and what is turned the inertia, of the rig file: an error of either changes its constants by "
    "its share, and K_over_J and the ratio not at all. With added_inertia a known ring on the shaft measures what turns.",
    "Then the ring turns by its certificate, and nothing else is put on with it, such as screws: the inertia and the torque "
    "constants change by the share that the ring's is off, 1 % by 1 %.",
    "An encoder's zero that is off by more than its tolerance takes its cosine: 10° electrical read 1.5 % less, in either "
    "sign. Set the zero first.",
    "Time is the controller's: a clock that is fast by 1e-4 changes constants by 2e-4.",
    "A scale of the position beyond its certificate changes the constants along by its share.",
)
COGGING_MAP = (
    "What the motors' constants are: a force is the current times a constant that is adopted or stated, and a constant that is "
    "wrong changes it by its share. Currents and shares do not need it.",
    "Encoders' zeros within what is stated or adopted: the currents go by 1 over the cosine of one that is off, 1.5 % at 10° "
    "electrical and 7 % at 21°, and the phases with it by its whole amount.",
    "A scale of the position beyond its certificate turns the phase along by its share of the way from where it reads zero: "
    "0.1 % at 12 mm of a period of 12.5 mm by 6 mrad.",
    "Third and higher harmonics: a third one is looked for, others are in no result.",
    "Forces that go with the way as cogging does, such as by the shaft's weight where it does not lie level: they are in it.",
    "Friction that is alike both ways is none: a constant force is in neither result.",
)
RUNOUT_MAP = (
    "Which of both is out of round: a target and magnets that are uneven turn the same currents, and only their difference is "
    "told. What moves along the shaft with the target alone may be seen in several places, where it is known to do so.",
    "The ratio of force per ampere and negative stiffness beyond its tolerances: vectors change by its share, currents do not.",
    "An encoder's zero beyond what is stated: vectors turn with the forces, 10° electrical by 17 % of their length across it. "
    "Set the zeros first.",
    "Probes and bearings whose axes are not those of the rig file: vectors turn with them.",
)
BEARING_CONSTANT = (
    "Both masses weigh as their certificates say: what both are off alike, such as by what hangs with them, changes the "
    "constants by its share. One against the other is checked.",
    "Nothing but the bearings carries the mover, such as a cable that pulls with the mass: 10 mN of 4 N are 0.25 %.",
)
ENCODER_ZERO = (
    "A force along that comes with the current along the field, such as by saliency: it looks like a field that is laid wrong. "
    "Of an actuator of 83.5 N/A 0.1 N for each ampere is 0.07° electrical.",
    "A reference frame of the captured currents that is not the one in which the controller regulates them.",
)
GATE_MARGIN = (
    "The mover at rest: while it moves it reads more, which a mission tells, and the catch has less to spare by as much.",
    "The force constant that the controller reckons with is the stated one: one that is 1 % greater makes the bearings' limit, "
    "in amperes, and so every catch margin 1 % less.",
    "The magnets' pull is the stated one, or by the plan's `pole` what both planes have together: a plane whose pull is 1 % "
    "greater is held 1 % less far, and its catch margin is told greater than it is by that.",
    "Planes that are caught one by one, by forces that come at once. A loop that answers late needs some of it: of a nominal "
    "machine whose force holds 69.9 µm, releases from rest are caught up to 64 to 66 µm.",
)
SENSOR_DELAY = (
    "A delay of the current's reading: what is told is that of the position less it.",
    "Damping of the shaft, by eddy currents or air: it turns the phase by c ω/(m ω² + K), most at the unstable pole's "
    "frequency, and a little of it reads as delay before it is a misfit.",
    "A shaft or a sensor's holder that bends: at a sixth of the first bending mode the phase is still that of a rigid one.",
    "Time is the controller's: a clock that is fast by 1e-4 makes delays smaller by that share.",
)
EMF_CONSTANT = (
    "Flux that grows with something else than the coordinate's phase: a field with a fifth harmonic of 1 % makes an emf that "
    "turns faster, and its mean over a turn is none.",
    "All voltages' sensors wrong alike by more than their certificates: flux and resistance by their share. A comparison with "
    "force per ampere shows it.",
    "Time is the controller's: a clock that is fast by 1e-4 makes the flux smaller by that share.",
    "Iron that saturates or eddies: the flux is that of the currents of these moves.",
)
COIL_MAP = (
    "The readings of the angle and of z are right: a share is of what the winding's table gives at these. 1 degree electrical "
    "moves what a coil is asked for by at most 1.7 % of its system's current, and its share by less than 0.1 %.",
    "A coil's current sensor beyond its certificate moves its coil's share by up to its whole error: 20 % are contradicted by "
    "its half-bridge's or by its star, 5 % not always, smaller ones are in no interval.",
    "Two errors that cancel: a coil connected the other way round whose probe reads with the wrong sign pushes the right way.",
    "A coil of a linear winding that carries no q where the mover lies: which way round it is connected shows in no motion.",
)
PULL_RATIO = (
    "Probes' axes that are rolled against the weight: 0.5° adds 0.15 µm to the magnetic centre across it, and as much of the "
    "weight's current to a current across. The reading without current is what it is.",
    "A pull that bends with the place: the ratio is that of a straight line over the levels. A pull that is 1 % stiffer at "
    "20 µm than at the middle changes it by about 0.3 %.",
    "Another angle or place along the shaft: what is uneven in the magnets and in the probes' target turns with the mover and "
    "moves the reading without current by its whole amount; the ratio it leaves alone.",
    "A coil's current sensor whose offset is beyond its certificate: 0.2 A of one coil move the reading without current by up "
    "to 0.66 µm.",
    "Force constants of both planes apart: no set point tells them, only what they have together.",
)
