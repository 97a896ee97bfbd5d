"""The public repositories that have recordings of real machines, and where their files are."""

from __future__ import annotations

from pathlib import Path

UR10E = "shamilmamedov/dynamic_calibration"
BLDC = "heitor-andrade/laas_anti_cogging"
OPENARM = "YIZHIXIAOCANGSHU/Friction-Identification-for-Manipulators"
CAMBER = "nicolazande/camber-control"
PANDA = "marcocognetti/FrankaEmikaPandaDynModel"
CART = "lucafalcone/Inverted_pendulum_sys_ID_and_control"
PENDULUM = "dfki-ric-underactuated-lab/torque_limited_simple_pendulum"
DOUBLE = "dfki-ric-underactuated-lab/double_pendulum"
KUKA = "JonasWeigand/Robot_Identification"
DAMPER = "ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash"
PROPELLER = "gergelytakacs/AutomationShield"
BEAM = "ryanGT/systemid"
TWO_MOTORS = "malik-robert/HSM150-data"
GO1 = "rimim/bam"
INSTRUMENT = "liamjosephnolan/thesis_matlab"
WHEEL = "vhsabino/MATLAB"
BARE_MOTOR = "gchenfc/ODrive"
WAM = "amir-noohian/dynamics-estimation"
CALIBRATED_ARMS = "thanhndv212/figaroh-examples"
LINKS = "lvjonok/mujoco-sysid"
FLEXIBLE_LINKS = "basta/quanser-2-dof-serial-flexible-link"
HOBBY_SERVO = "spfrommer/servo-experiment"
SURGICAL = "WPI-AIM/dvrk_dynamics_identification"
LIGHT_ARMS = "SedkiLmm/dynamic-identification"
AR5 = "FrankJIE09/Dynamics_identification_Frank"
UR10 = "kiwiwan/ur10_dyn_ident"
JOINT_FRICTION = (
    "longshike/NNFM-A-Novel-Neural-Network-Modeling-Approach-for-Robot-Flexible-Joints-Friction"
)
XMATE = "NKU-ZiXuan/xMate7p_dyn_ident"
DISCS = "ArsenLpn/372lab1"
EGG_LIFT = "EliasWR/CyberneticsEggdrop"
TWISTED_STRINGS = "hop9999/antagonist_setup"
TENDON_DRIVES = "RViMLab/TRO2021-Dynamic-Modelling"
RACK = "KonradMnich/friction-identification"
DRIVETRAIN = "MiamiBeachBots/base-bot"
FLYWHEEL = "calcmogul/SysIdOpt"
POSITION_SERVO = "mauicv/servo-sysid"
SCHUNK = "nikhilushinde/AutoKoopman"
ROD_MOTOR = "Alex-Jagger/277_Assignments"
CYLINDER = "EvaZillen/3D-printed-pneumatic-actuator"
MILL = "ejhusom/cnc_milling_tool_wear"
STAGES = "ParthSareen/controls-projects"
WHEELS = "opatiny/micromouse"
COUPLED_MOTORS = "HoriFujimotoLab/FdiTools"
GUIDES = "meco-group/lc_toolbox"
CRANE = "Cristian-Napitupulu/gantry_crane_ws"
BELT_CART = "SensorsINI/physical-cartpole"
SMALL_SERVO = "TeacherRock/LuGre_Friction"
SEVENTH_JOINT = "HBRS-SDP/joint-friction-model"
INSTRUMENT_DRIVE = "MRDLab/mis-tool-characterization"
WINCHES = "eliasoa/TTK4900_CDPR"
STUDENTS_MOTOR = "Korn-XD/Control_LAB_1"
SHAKING_TABLE = "labcontrol-data/randomized_LPV_shakingTable"
FLUID_DAMPERS = "labcontrol-data/mr-damper"
GIMBAL_MOTOR = "Cobular/LKMTechCanDriver-Rust"
SERVO_PROJECT = "adamb314/ServoProject"
COMPASS = "imanchester/SydneyCompassGait"
CARRIED_ARM = "MatWieckowski/anti_gravity"
EXOSKELETON = "chimnonvuive/ExoModel"
LIGHT_ELBOW = "saloutos/system_identification"
ANKLES = "leon-sir/my_tools"
LOADER = "Trobolit/R7015E_lab4"
BALANCING_CAR = "dongdaming1966/mcar_simulate"
COURSE_MOTOR = "MINIFI2548/FRA233_Lab1_System_Identification"
SMALLER_SERVO = "TeacherRock/Lorenz_Friction"
RANDOM_VOLTS = "guanlunlu/motor_system_identification"
TACHOMETER = "johnnv1/compensator_projects"
TWO_ARMS = "hujinfei1994/dyn_ident_dualArmV2"
COURSE_GROUP = "thuxrife/FRA233_Lab1_G04"
LEARNT_ACTUATOR = "WJJJ2004/actuator_net"
DYNAMOMETER = "karthikurs/actuator-dynamometer"
MACHINE_AXIS = "CiganOliviu/brushless-DC-electric-motor-identification"
LIFTED_ARM = "labcontrol-data/quasiLPV-vtol"
ROTARY_PENDULUM = "decargroup/closed_loop_koopman"
CYLINDER_LOAD = "DanielMartensson/MataveID"
AERO = "finnferdinand/orbital-stabilization-quanser-aero"
ROMI = "Robohawk2022/romi-lab"
SEESAW_CART = "Negm2000/Seesaw"
TWO_RODS = "FabianBallast/IntegrationProject"
REACTION_WHEEL = "sachinumans/IntegrationProject2022"
PENDULUM_WHEEL = "jackh1nes/Integration_Project"
BARE_ROD = "chewy441014/mae277_assign2"
THIN_LINK = "gleylaz/Optimal_SysID"
JOINT_DRIVE = "mmaag01/Actuator-Net"
PRINTED_GEAR = "JelmerV/Anti-Backlash-Cycloidal-Actuator"
LIGHT_ARM = "kjyv/FloBaRoID"
EXCAVATOR = "mitchallain/BeagleBone-excavator"
GEARED_TOOL = "gramaziokohler/integral_timber_joints"
LEARNT_ARM = "Cambridge-Control-Lab/Passive_lifted_FIR_filters_for_nonlinear_system_identification"
CURRENT_CART = "nielsSkov/masterThesisMatlab"
BUS_MOTORS = "YIZHIXIAOCANGSHU/Friction-Identification-for-Manipulators_usb2fdcan"
TEST_INPUTS = "labmrd/odrive-with-motor-characterization"
BALANCING_ROBOT = "MadsRudolph/REGBOT-Balance"
DIRECT_DRIVE = "jorgevchin/Friction-Identification"
PUMP_ACTUATOR = "ivliev123/Electro-Hydraulic-Actuator"
REPOSITORIES = (
    UR10E,
    BLDC,
    OPENARM,
    CAMBER,
    PANDA,
    CART,
    PENDULUM,
    DOUBLE,
    KUKA,
    DAMPER,
    PROPELLER,
    BEAM,
    TWO_MOTORS,
    GO1,
    INSTRUMENT,
    WHEEL,
    BARE_MOTOR,
    WAM,
    CALIBRATED_ARMS,
    LINKS,
    FLEXIBLE_LINKS,
    HOBBY_SERVO,
    SURGICAL,
    LIGHT_ARMS,
    AR5,
    UR10,
    JOINT_FRICTION,
    XMATE,
    DISCS,
    EGG_LIFT,
    TWISTED_STRINGS,
    TENDON_DRIVES,
    RACK,
    DRIVETRAIN,
    FLYWHEEL,
    POSITION_SERVO,
    SCHUNK,
    ROD_MOTOR,
    CYLINDER,
    MILL,
    STAGES,
    WHEELS,
    COUPLED_MOTORS,
    GUIDES,
    CRANE,
    BELT_CART,
    SMALL_SERVO,
    SEVENTH_JOINT,
    INSTRUMENT_DRIVE,
    WINCHES,
    STUDENTS_MOTOR,
    SHAKING_TABLE,
    FLUID_DAMPERS,
    GIMBAL_MOTOR,
    SERVO_PROJECT,
    COMPASS,
    CARRIED_ARM,
    EXOSKELETON,
    LIGHT_ELBOW,
    ANKLES,
    LOADER,
    BALANCING_CAR,
    COURSE_MOTOR,
    SMALLER_SERVO,
    RANDOM_VOLTS,
    TACHOMETER,
    TWO_ARMS,
    COURSE_GROUP,
    LEARNT_ACTUATOR,
    DYNAMOMETER,
    MACHINE_AXIS,
    LIFTED_ARM,
    ROTARY_PENDULUM,
    CYLINDER_LOAD,
    AERO,
    ROMI,
    SEESAW_CART,
    TWO_RODS,
    REACTION_WHEEL,
    PENDULUM_WHEEL,
    BARE_ROD,
    THIN_LINK,
    JOINT_DRIVE,
    PRINTED_GEAR,
    LIGHT_ARM,
    EXCAVATOR,
    GEARED_TOOL,
    LEARNT_ARM,
    CURRENT_CART,
    BUS_MOTORS,
    TEST_INPUTS,
    BALANCING_ROBOT,
    DIRECT_DRIVE,
    PUMP_ACTUATOR,
)
"""On GitHub."""
COMMITS = {
    BARE_MOTOR: "54611550c141fb024b663d1d17fc98dc2c5b7fd3",
    LINKS: "b30002b6f7fb9bb7d4410ab304c18fbcbbedcfd5",
    CRANE: "adf4a81b4a2389b1dff19aad86cbc33450f59e54",
    BELT_CART: "89b023a2117fcd8a74efc22a287523423317abdf",
    SCHUNK: "3897268a9545555f8010b2b7ed913645fb87fc13",
    JOINT_DRIVE: "07b1c87367dc0e1ec8c997cf8749f150f2d6c4d6",
    PRINTED_GEAR: "39055cd060f2dc5ee879736050a97bd66ba0adcc",
    LIGHT_ARM: "4e2e5a2992f2175aa4e494c0d827590435a969a8",
    GEARED_TOOL: "ff4e975575192240cff803e6feb1aca075ab48c2",
}
"""Of those whose newest commit has not the recordings."""


def folder_of(recordings: Path, repository: str) -> Path:
    """Return where a repository's files are."""
    return recordings / repository.replace("/", "+")
