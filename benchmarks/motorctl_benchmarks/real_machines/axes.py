"""The axes of public recordings, and what may be said of each.

What each machine is was found by an analysis apart from `diagnose` (docs/real_machines.md).
"""

from __future__ import annotations

from motorctl_benchmarks.real_machines.arm_readers import (
    ar5,
    joint_friction,
    kinova,
    schunk,
    surgical,
    surgical_yaw,
    ur5,
    ur10,
    xmate,
)
from motorctl_benchmarks.real_machines.bench_readers import (
    belt_cart,
    coupled_motors,
    crane_cart,
    guide,
    seventh_joint,
    small_servo,
    trolley,
)
from motorctl_benchmarks.real_machines.cart_and_bus_axes import CART_AND_BUS
from motorctl_benchmarks.real_machines.course_readers import (
    bare_rod,
    pendulum_wheel,
    reaction_wheel,
    seesaw_cart,
    thin_link,
    upper_rod,
)
from motorctl_benchmarks.real_machines.drive_readers import (
    course_motor,
    creeping_servo,
    fluid_damper,
    gimbal_motor,
    instrument_drive,
    random_volts,
    shaking_table,
    smaller_servo,
    students_motor,
    tachometer,
    winch,
)
from motorctl_benchmarks.real_machines.lab_readers import (
    DRIVETRAIN_RUNS,
    FLYWHEEL_RUNS,
    discs,
    milling_axis,
    pulled_cylinder,
    rod_motor,
    tendon_drive,
    twisted_strings,
)
from motorctl_benchmarks.real_machines.loop_readers import (
    aero,
    hanging_load,
    romi,
    rotary_pendulum,
    stairs_motor,
)
from motorctl_benchmarks.real_machines.motor_readers import (
    brake,
    course_group,
    learnt_actuator,
    lifted_arm,
    machine_axis,
    one_joint,
    shaft,
    two_arms,
)
from motorctl_benchmarks.real_machines.readers import (
    actuator,
    arm,
    bare_motor,
    beam,
    brushless,
    cart,
    damper,
    double,
    driven_pendulum,
    flexible_link,
    flywheel,
    instrument,
    joint,
    kuka,
    panda,
    pendulum,
    tiago,
    two_links,
    two_motors,
    tx40,
    walking_joint,
    wam,
    wheel,
)
from motorctl_benchmarks.real_machines.real_axis import RealAxis
from motorctl_benchmarks.real_machines.stage_readers import (
    STIFF,
    STIFF_LATER,
    TWO_MASSES,
    ball_on_beam,
    geared_motor,
    levitated_magnet,
    stage,
    wheel_of_mouse,
)
from motorctl_benchmarks.real_machines.walker_readers import (
    ankle,
    balancing_car,
    carried_arm,
    compass_leg,
    exoskeleton_motor,
    light_elbow,
    walking_hip,
)
from motorctl_benchmarks.real_machines.workshop_readers import (
    DRIVE_RUNS,
    GEARS,
    excavator,
    geared_tool,
    joint_drive,
    learnt_arm,
    light_arm,
    printed_gear,
)

LIN_A = actuator("LinA/data/pp-sine-sweep-10mm-0.5Hz.txt")
LIN_B = actuator("LinB/data/no-load-square-wave-half-travel-3Hz.txt")
LIN_D = actuator("LinD/data/no-pp-sine-sweep-10mm-0.5Hz.txt")
ECC_A = actuator("EccA/data/load-square-wave-full-travel-1Hz.txt")
CART_CHIRP = cart("chirp2_20260608_113318.mat")
CART_LINES = cart("multisin_20260506_191743.mat")
IN_A = "design_A.0/20220815/sys_id/trajectory_03.csv"
IN_C = "design_C.1/sys_id/20230629/20230629-143601/trajectory.csv"
PENDULUM_RUNS = ("20230828T150615_434_696_394", "20230828T162549_043_857_715")
GRAVITY = ("gravity",)
CARRIED = ("gravity", "position_force", "cross_axis")
"""What a joint may be said to have that another joint carries."""
TURNS_IN_GEAR = ("cogging", "force_ripple", "gravity", "cross_axis", "stribeck")
"""The motors of an arm have eight poles' torque a turn, the gears their friction."""
SWINGING = ("flexible_mode", "dead_zone", "input_lag", "input_delay", "cross_axis", "stribeck")
"""The cart's: its authors found a dead zone, and the pendulum swings at 0.8 Hz."""
HYSTERESIS = ("presliding", "stribeck")
SWAYS = ("position_force", "periodic_disturbance")
"""A force of 3.75 to 3.86 Hz acts on the magnet all the time; its frequency wanders."""
SWING_UP = pendulum("control_method_ddp/data_measured.csv")
SWING_UP_SHORT = pendulum("control_method_direct_collocation/data_measured.csv")
SWING_UP_SLOW = pendulum("control_method_ilqr/data_measured.csv")
SWINGING_ROD = pendulum("filter_method_fft/measured_data.csv")
BY_HAND = pendulum("control_method_gravity_compensation/data_measured.csv")
HELD_BY_TORQUE = pendulum("control_method_pd/1nm_torque_limited_swingup_failure/data_measured.csv")
BAND_BRAKE = damper("0.5Hz30lbtension1amplitude.json")
WALKING = {
    "3 kg, slow": "2025-05-13_05h09m03.json",
    "3 kg, quick": "2025-05-13_05h09m27.json",
    "1 kg, quick": "2025-05-13_05h06m12.json",
}
HANGING = ("gravity", "position_force")
INSTRUMENT = {
    "roll": instrument("roll_prbs_response/prbs_roll_m20_pitch_m20.csv", "roll"),
    "pitch": instrument("pitch_prbs_response/prbs_roll_0_pitch_0.csv", "pitch"),
    "pitch elsewhere": instrument("pitch_prbs_response/prbs_roll_20_pitch_15.csv", "pitch"),
}
ON_CABLES = ("flexible_mode", "input_lag", "input_delay", "position_force")
"""Its frequency response has an antiresonance at 3 to 4 Hz and a resonance above it."""
COGGING_SLOWLY = {
    "0.03 turns/s": "slow2_slower/nocomp_0",
    "0.1 turns/s": "slow_goodgains_2/nocomp_0",
    "0.1 turns/s again": "slow2/nocomp_0",
    "0.03 turns/s, compensated": "slow2_slower/comp_0",
}
OF_LINKS = ("gravity", "position_force", "cross_axis", "flexible_mode")
"""The second link is driven by a belt."""
BENDING = ("flexible_mode", "cross_axis")
ON_TENDONS = (*HANGING, "flexible_mode")
"""Both first joints of the instrument have an antiresonance at 2 to 2.4 Hz."""
CUTS = ("stribeck",)
"""What friction leaves is the force of cutting; at low speed it is larger."""
WITH_PLAY = ("backlash", "flexible_mode")
"""After a step of the voltage the motor runs ahead alone for 4 ms and waits for 5 ms; the second
mass hangs on a spring whose antiresonance its authors put at 2.5 Hz."""
SEEN_AT_THE_LOAD = (*WITH_PLAY, "input_lag", "input_delay")
RUNS_ONE_WAY = ("quadratic_drag", "input_lag", "input_delay")
COUPLED = ("flexible_mode",)
"""Motor and load hang together by a coupling: antiresonance at 54 Hz, resonance at 76 Hz."""
ON_A_SPRING = ("flexible_mode", "position_force")
"""A spring holds the motor in its place (1 Hz), another the second mass: antiresonance at 11 Hz."""
TROLLEY = "Step response 700 with random"
LATE_DUTY = ("input_lag", "input_delay", "cross_axis")
"""The cart answers 10 ms late, and the pole swings on it."""
BELT_CARTS = {
    "steps": "5ms Trajectories/CP_PID_2022-01-20_21-44-38 5ms measurement short",
    "longer": "20ms Trajectories/CP_PID_2022-01-21_18-56-13 20ms measurement",
    "swing-up": "Results/Swingup/CP_mppi-tf-Euler_2022-02-21_01-27-23",
}
AGAINST_A_BRAKE = ("position_force",)
"""The brake pulls back with a force that grows with the angle."""
LATE_MOTION = ("input_lag", "input_delay")
"""The table moves 40 to 50 ms after its voltage; the motor's speed is told 12 to 24 ms late."""
TURNS_OVER = ("cogging", "presliding")
"""Waves of 5, 10 and 20 a turn, and a torque that rises over the first 50 mrad."""
FALLING = (*HANGING, *LATE_MOTION)
"""An angle that grows by itself, 20 ms behind the wheels."""
SWINGING_LOAD = ("gravity", "flexible_mode")
"""At rest the torque is a sine of the angle; acceleration over torque has a dip at 11 Hz."""
YIELDS = ("presliding", "position_force")
"""A magnetic fluid that bends before it yields, and a gas spring."""
STUDENT_RUNS = {
    "chirp": "2026-02-06_20-21-20_Chirp",
    "stairs": "2026-02-06_20-12-42_Stair",
    "sine": "2026-02-06_20-06-51_Sine_pi",
}
ON_A_ROD = (*HANGING, *HYSTERESIS, "cross_axis", "input_lag", "input_delay")
"""A second rod hangs on the first; friction turns over more steeply than declared."""
UPPER_ROD = {"2.2 Hz": "sin2p2Hz", "3 Hz": "sin3Hz", "steps": "square", "chirp": "chirp"}
WHEEL_RUNS = {
    "chirp": "grey_chirp_0025_075Hz_cropped",
    "sweep": "Exp5_fullSweepFinalCropped",
    "sine": "grey_sine_0_1Hz_cropped",
    "ramp": "grey_MotorID_ramp_cropped",
}
WHEELS_ON_PENDULUM = {"chirp": "Data/chirp", "signal": "Data/signal_1_1_6"}
WHEEL_ALONE = pendulum_wheel("Archive/Isolated_Flywheel_action", "stim_input_1")
SHOWS_ITS_TURNS = (*LATE_MOTION, "encoder_error")
"""The speed has a ripple of one a turn that grows with it, as an error of the place does."""
COURSE_STAIRS = "part2_Stair_1_2026-01-31_16-05/Stair_Raw.mat"
COURSE_SINE = "part2_Sine_1_2026-01-31_19-10/Sine_Raw.mat"
SHAFT_RANDOM = "futek_test_06_05_2021_14-21-05.csv"
SHAFT_HELD = "futek_test_13_05_2021_18-10-31.csv"
NO_BRAKE = "speed_test_13_02_2021_13-53-46.csv"
ON_A_BENCH = ("flexible_mode",)
"""Position over torque is least at 10 Hz, and in phase from 15 Hz on."""
HELD_OUTPUT = ("position_force", "presliding", "backlash")
"""The gear is a spring with play and hysteresis between the motor and what holds the output."""
VALVES = (*LATE_MOTION, "dead_zone")
"""A valve that gives a speed, 100 to 170 ms later, and none around its middle."""
TABLE_RUNS = {"chirp": "chirpFi1Ff9", "square": "SquareA5F08", "random": "RandomA05F01"}
FAIRINO_3 = joint_friction("FAIRINO Robot/verify_robot_S_slow_processed.csv")
FRANKA_2 = joint_friction("Franka Robot/case3_high.csv")
AXES: tuple[RealAxis, ...] = (
    RealAxis("brushless motor", brushless, "A", ("cogging", "periodic_disturbance")),
    RealAxis("UR10e joint 1", joint(1), "A"),
    RealAxis("UR10e joint 2", joint(2), "A", (*GRAVITY, "position_dependent_friction")),
    RealAxis("UR10e joint 3", joint(3), "A", GRAVITY),
    RealAxis("UR10e joint 4", joint(4), "A", (*GRAVITY, "position_force", "presliding")),
    RealAxis("UR10e joint 5", joint(5), "A", ("presliding",)),
    RealAxis("UR10e joint 6", joint(6), "A"),
    RealAxis("OpenArm joint 1", arm(1), "N*m", GRAVITY),
    RealAxis("OpenArm joint 3", arm(3), "N*m"),
    RealAxis("OpenArm joint 6", arm(6), "N*m"),
    RealAxis("OpenArm joint 7", arm(7), "N*m"),
    RealAxis("screw actuator A", LIN_A, "mA", position_unit="mm"),
    RealAxis("screw actuator B", LIN_B, "A", position_unit="mm", scale=-1),
    RealAxis("screw actuator D", LIN_D, "mA", position_unit="mm"),
    RealAxis("eccentric actuator A", ECC_A, "A", position_unit="deg", scale=-1),
    *(RealAxis(f"Panda joint {k}", panda(k), "N*m") for k in (1, 2, 3, 5)),
    RealAxis("Panda joint 7", panda(7), "N*m", ("presliding",)),
    RealAxis("cart, chirp", CART_CHIRP, "%", SWINGING, position_unit="m"),
    RealAxis("cart, many sines", CART_LINES, "%", SWINGING, position_unit="m"),
    RealAxis("pendulum, swing-up of 6 s", SWING_UP, "N*m", GRAVITY),
    RealAxis("pendulum, swing-up of 3.5 s", SWING_UP_SHORT, "N*m", GRAVITY),
    RealAxis("pendulum, swinging", SWINGING_ROD, "N*m", GRAVITY),
    *(RealAxis(f"two joints A, joint {k}", double(IN_A, k), "N*m", CARRIED) for k in (1, 2)),
    *(RealAxis(f"two joints C, joint {k}", double(IN_C, k), "N*m", CARRIED) for k in (1, 2)),
    *(
        RealAxis(f"KR 300 axis {k}", kuka(k), "N*m", TURNS_IN_GEAR, position_unit="deg")
        for k in range(1, 7)
    ),
    RealAxis("band brake", BAND_BRAKE, "N", HYSTERESIS, position_unit="mm"),
    RealAxis("ruler on a motor", beam, "%", ("flexible_mode", "input_lag", "input_delay")),
    RealAxis("motor against a motor", two_motors, "N*m"),
    *(
        RealAxis(f"walking robot's joint, {what}", walking_joint(name), "N*m", HANGING)
        for what, name in WALKING.items()
    ),
    *(
        RealAxis(f"instrument, {what}", read, "%", ON_CABLES, position_unit="deg", scale=-1)
        for what, read in INSTRUMENT.items()
    ),
    RealAxis("wheel in the air, one way", wheel, "%"),
    *(
        RealAxis(f"bare motor, {what}", bare_motor(name), "A", ("cogging",))
        for what, name in COGGING_SLOWLY.items()
    ),
    RealAxis("WAM joint 2", wam(2), "N*m", (*GRAVITY, "cross_axis")),
    *(RealAxis(f"TX40 axis {k}", tx40(k), "A", ("cross_axis",), "deg") for k in (1, 4, 6)),
    *(RealAxis(f"TX40 axis {k}", tx40(k), "A", CARRIED, "deg") for k in (2, 3)),
    RealAxis("TIAGo torso", tiago("torso_lift"), "A", ("hard_stop",), "m"),
    RealAxis("TIAGo joint 1", tiago("arm_1"), "A", ("cross_axis",)),
    RealAxis("TIAGo joint 2", tiago("arm_2"), "A", CARRIED),
    RealAxis("TIAGo joint 4, turned", tiago("arm_4"), "A", CARRIED, scale=-1),
    *(RealAxis(f"flywheel {k}", flywheel(k), "mA") for k in (1, 4)),
    *(RealAxis(f"driven pendulum {k}", driven_pendulum(k), "A", GRAVITY) for k in (1, 2)),
    *(
        RealAxis(f"two links, {speed}, link {k}", two_links(speed, k), "mA", OF_LINKS)
        for speed in ("fast", "norm", "slow")
        for k in (1, 2)
    ),
    *(
        RealAxis(f"flexible links, stage {k}", flexible_link(k), "A", BENDING, "deg")
        for k in (1, 2)
    ),
    *(RealAxis(f"surgeon's arm, joint {k}", surgical("mtm", k), "N*m", CARRIED) for k in (1, 2, 3)),
    RealAxis("surgeon's arm, joint 4", surgical("mtm", 4), "N*m", ("position_force",)),
    RealAxis("surgeon's arm, yaw alone", surgical_yaw, "N*m", ("position_force",)),
    *(RealAxis(f"instrument, joint {k}", surgical("psm", k), "N*m", ON_TENDONS) for k in (1, 2)),
    RealAxis("instrument, insertion", surgical("psm", 3), "N", position_unit="m"),
    *(RealAxis(f"UR5 joint {k}", ur5(k), "A") for k in (1, 5)),
    *(RealAxis(f"UR5 joint {k}", ur5(k), "A", CARRIED) for k in (2, 3, 4)),
    RealAxis("UR5 joint 6", ur5(6), "A", ("presliding",)),
    *(RealAxis(f"Gen3 joint {k}, one move", kinova(k), "A") for k in (1, 3, 5, 7)),
    *(RealAxis(f"Gen3 joint {k}, one move", kinova(k), "A", HANGING) for k in (2, 4, 6)),
    *(RealAxis(f"AR5 joint {k}", ar5(k), "N*m", CARRIED) for k in (1, 5, 6, 7)),
    *(RealAxis(f"UR10 joint {k}", ur10(k), "N*m", CARRIED) for k in (1, 2, 6)),
    *(RealAxis(f"xMate joint {k}, acceleration", xmate(k), "N*m") for k in (1, 3)),
    RealAxis("FR5 joint 3, friction", FAIRINO_3, "N*m", (*TURNS_IN_GEAR, "presliding")),
    RealAxis("Panda joint 2, friction", FRANKA_2, "N*m", ("position_force",)),
    RealAxis("discs on a torsion rod", discs, "V", BENDING),
    *(
        RealAxis(f"twisted string, motor {k}", twisted_strings(k), "A", ("position_force",))
        for k in (1, 2)
    ),
    *(RealAxis(f"tendon drive {k}", tendon_drive(k), "%", (), "turn") for k in (1, 3)),
    RealAxis("robot's wheels", DRIVETRAIN_RUNS, "V", position_unit="m"),
    RealAxis("robot's flywheel", FLYWHEEL_RUNS, "V"),
    *(RealAxis(f"LWA joint {k}", schunk(80, k), "N*m", (*CARRIED, "cogging")) for k in range(1, 7)),
    RealAxis("LWA joint 4, another move", schunk(84, 4), "N*m", (*CARRIED, "cogging")),
    *(RealAxis(f"LWA joint {k}, a third move", schunk(18, k), "N*m", CARRIED) for k in (1, 4, 5)),
    RealAxis("motor with a rod", rod_motor, "%"),
    RealAxis("pulled cylinder, O-ring", pulled_cylinder("O-ring_5bar"), "N", LATE_MOTION, "mm"),
    RealAxis("pulled cylinder, round seal", pulled_cylinder("Circle_7bar"), "N", LATE_MOTION, "mm"),
    *(RealAxis(f"milling machine, {c}", milling_axis(c), "A", CUTS, "mm") for c in ("X", "Y")),
    RealAxis("stiff drive, to and fro", stage(f"{STIFF}/2_2_Kp_0.5", "x"), "V", WITH_PLAY, "mm"),
    RealAxis(
        "stiff drive, steps", stage(f"{STIFF}/2_1_velocity_response", "v"), "V", WITH_PLAY, "mm"
    ),
    RealAxis("stiff drive, moves", stage(f"{STIFF_LATER}/q2_2", "x"), "V", WITH_PLAY, "mm"),
    RealAxis("stiff drive, 1 mm", stage(f"{STIFF_LATER}/q2_1_a", "x"), "V", WITH_PLAY, "mm"),
    *(
        RealAxis(f"two masses, {what}", stage(f"{TWO_MASSES}/{name}", column), "V", may_name, "mm")
        for what, name, column, may_name in (
            ("steps", "velocity_response_2", "v1", WITH_PLAY),
            ("steps, load", "velocity_response_2", "v2", SEEN_AT_THE_LOAD),
            ("3 Hz", "velocity_response_sine_3", "v1", WITH_PLAY),
            ("load in a loop", "2_2_kp_0_2", "x2", SEEN_AT_THE_LOAD),
        )
    ),
    RealAxis("geared motor, one way", geared_motor, "V", RUNS_ONE_WAY),
    RealAxis("levitated magnet", levitated_magnet, "mA", SWAYS, "mm", scale=-1),
    RealAxis("ball on a beam", ball_on_beam("dataPidAll", 1, 2), "%", (), "mm"),
    *(
        RealAxis(f"mouse's wheel, {name}", wheel_of_mouse(name), "%", (), "turn")
        for name in ("testPid1", "testPid6")
    ),
    *(
        RealAxis(f"coupled motors, {kind}, {side}", coupled_motors(kind, side), "A", COUPLED)
        for kind in "AB"
        for side in ("motor", "load")
    ),
    *(
        RealAxis(f"guide, run {k}, mass {m}", guide(k, m), "V", ON_A_SPRING, "mm", scale=-1)
        for k, m in ((1, 1), (1, 2), (3, 1), (3, 2))
    ),
    RealAxis("crane's cart, speed", crane_cart, "V", position_unit="m"),
    *(
        RealAxis(f"trolley{more}", trolley(f"{TROLLEY}{more}"), "V", position_unit="m")
        for more in ("", " v1")
    ),
    *(
        RealAxis(f"cart on a belt, {what}", belt_cart(name), "%", LATE_DUTY, "m")
        for what, name in BELT_CARTS.items()
    ),
    *(
        RealAxis(f"small servo, {name}", small_servo(name), "N*m", HYSTERESIS)
        for name in ("J_1", "01")
    ),
    *(
        RealAxis(f"seventh joint, {speed} rad/s", seventh_joint(f"{speed}00000"), "A")
        for speed in ("0.5", "1.5")
    ),
    *(
        RealAxis(f"instrument's drive, {hz} Hz", instrument_drive(name), "A", AGAINST_A_BRAKE)
        for hz, name in ((0.1, "00"), (0.3, "22"), (0.5, "43"))
    ),
    RealAxis(
        "instrument's drive, torque", instrument_drive("43", "torque"), "N*m", AGAINST_A_BRAKE
    ),
    *(
        RealAxis(f"shaking table, {what}", shaking_table(name), "V", LATE_MOTION, "mm")
        for what, name in TABLE_RUNS.items()
    ),
    *(
        RealAxis(f"students' motor, {what}", students_motor(name), "V", LATE_MOTION)
        for what, name in STUDENT_RUNS.items()
    ),
    *(
        RealAxis(f"fluid damper, {name}", fluid_damper(name), "N", YIELDS, "mm")
        for name in ("ensaio.A.1", "ensaio1")
    ),
    RealAxis("rod on a gimbal motor, turned", gimbal_motor, "%", SWINGING_LOAD, "deg", -1),
    RealAxis("winch 3, Down25", winch(3, "Down25"), "A", HANGING, "turn"),
    RealAxis("creeping servo", creeping_servo, "%", ("cogging",), "turn"),
    *(
        RealAxis(f"compass walker, {leg} leg", compass_leg(leg), "V", HANGING, "deg")
        for leg in ("outer", "inner")
    ),
    RealAxis("compass walker, walking", walking_hip, "V", HANGING, "deg"),
    RealAxis("arm carried by its motor", carried_arm, "N*m", HANGING, "deg"),
    *(
        RealAxis(f"exoskeleton's motor {number}", exoskeleton_motor(number), "A")
        for number in (1, 2, 3, 4)
    ),
    *(RealAxis(f"elbow, log {log}", light_elbow(log), "N*m", HANGING) for log in (2, 4)),
    *(RealAxis(f"walking ankle {number}", ankle(number), "N*m") for number in (2, 3)),
    RealAxis("balancing car, turned", balancing_car, "%", FALLING, scale=-1),
    RealAxis("course motor, current", course_motor("chirp 1", "current"), "A", LATE_MOTION),
    *(
        RealAxis(f"smaller servo, {name}", smaller_servo(name), "N*m", TURNS_OVER)
        for name in ("S1_10", "10")
    ),
    RealAxis("random volts", random_volts, "V", LATE_MOTION),
    *(
        RealAxis(f"tachometer{where}", tachometer(looped), "V", LATE_MOTION)
        for where, looped in (("", False), (" in a loop", True))
    ),
    *(RealAxis(f"two arms, joint {n}", two_arms(n), "A", HANGING, "deg") for n in (1, 2)),
    *(RealAxis(f"two arms, joint {n} alone", one_joint(n), "A", HANGING, "deg") for n in (2, 4)),
    RealAxis("course group's stairs", course_group(COURSE_STAIRS), "V", LATE_MOTION),
    RealAxis("course group's sine", course_group(COURSE_SINE), "V", LATE_MOTION),
    RealAxis("machine tool's axis", machine_axis, "%", LATE_MOTION),
    RealAxis("learnt actuator", learnt_actuator("motorStateCur_0"), "A", FALLING),
    RealAxis("learnt actuator, where it is sent", learnt_actuator("motorAction_0"), "N*m", HANGING),
    RealAxis("shaft, random torque", shaft(SHAFT_RANDOM, "a1 torque cmd [Nm]"), "N*m", LATE_MOTION),
    RealAxis("shaft, the drive's torque", shaft(SHAFT_RANDOM, "a1 torque [Nm]"), "N*m"),
    RealAxis("shaft that is held", shaft(SHAFT_HELD, "a1 torque [Nm]"), "N*m", ("position_force",)),
    RealAxis(
        "steady speed without a brake",
        brake(NO_BRAKE, "velocity measured [Hz]", "motor torque measured [Nm]"),
        "N*m",
        position_unit="turn",
    ),
    RealAxis("arm on propellers", lifted_arm, "V", FALLING),
    *(
        RealAxis(f"rotary pendulum, {name[9:15]}", rotary_pendulum(name), "V", LATE_MOTION)
        for name in PENDULUM_RUNS
    ),
    RealAxis("load on a cylinder", hanging_load, "V", LATE_MOTION, "mm"),
    RealAxis("motor at stairs", stairs_motor, "V", LATE_MOTION),
    RealAxis(
        "two propellers, pitch", aero("Experiment 1 - Nominal/PD Controller", 0), "V", FALLING
    ),
    RealAxis(
        "small robot, ramp", romi("20221106-174834", "slow-forward"), "V", position_unit="turn"
    ),
    RealAxis("seesaw's cart", seesaw_cart, "V", HYSTERESIS, "m"),
    *(
        RealAxis(f"upper rod, {what}, turned", upper_rod(name), "%", ON_A_ROD, scale=-1)
        for what, name in UPPER_ROD.items()
    ),
    *(
        RealAxis(f"reaction wheel, {what}", reaction_wheel(name), "%", LATE_MOTION)
        for what, name in WHEEL_RUNS.items()
    ),
    RealAxis(
        "pendulum on a wheel, turned",
        reaction_wheel(WHEEL_RUNS["chirp"], "position"),
        "%",
        FALLING,
        scale=-1,
    ),
    *(
        RealAxis(f"wheel on a pendulum, {what}", pendulum_wheel(name), "%", LATE_MOTION)
        for what, name in WHEELS_ON_PENDULUM.items()
    ),
    RealAxis("wheel on a pendulum, alone", WHEEL_ALONE, "%", SHOWS_ITS_TURNS),
    RealAxis("bare motor with a rod", bare_rod("id_data/1"), "V"),
    RealAxis("thin link", thin_link, "V", BENDING, "deg"),
    *(RealAxis(f"joint drive, {run}", joint_drive(run), "A", ON_A_BENCH) for run in DRIVE_RUNS),
    *(
        RealAxis(f"held gear, {kind}", printed_gear(kind), "A", HELD_OUTPUT, "turn")
        for kind in GEARS
    ),
    *(RealAxis(f"LWR joint {k}", light_arm(k), "N*m", CARRIED) for k in range(1, 8)),
    *(
        RealAxis(f"excavator's {name.lower()}", excavator(name), "%", VALVES, "mm")
        for name in ("Boom", "Stick", "Bucket", "Swing")
    ),
    *(
        RealAxis(f"geared tool, move {run}.{k}", geared_tool(run, k), "%", LATE_MOTION, "deg")
        for run, k in (("06", 0), ("07", 2))
    ),
    *(RealAxis(f"learnt arm, {run}", learnt_arm(run), "N*m") for run in ("e", "v3")),
    *CART_AND_BUS,
)
