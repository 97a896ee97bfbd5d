"""The axes of a cart, motors on a bus, a balancing robot, a direct drive and a pump."""

from __future__ import annotations

from motorctl_benchmarks.real_machines.cart_and_bus_readers import (
    balancing_wheel,
    bus_motor,
    current_cart,
    direct_drive,
    driven_by_test,
    pump_actuator,
)
from motorctl_benchmarks.real_machines.real_axis import RealAxis

ON_A_BELT = ("flexible_mode", "backlash", "position_dependent_friction", "input_delay")
"""After each switch of the current the cart rings at 10 to 15 Hz and is damped; the current is
recorded a sample off. Its authors found friction that varies with the place."""
STICKS = ("stribeck", "presliding")
"""Its makers' breakaway torque is up to twice that of sliding."""
CART_RUNS = {
    "switched at 0.40 m": "parameterEstimation/data/cartTest2/0m40",
    "switched at 0.20 m": "parameterEstimation/data/cartTest3/0m20",
    "switched over 0.28 m": "parameterEstimation/data/cartTest1/testOffPointSix",
}
SWING_UP_RUN = "testResults/data/swingUpAndCatch/swNsl4"
PUMP_RUN = "test_2024_10_17_test_6____"

CART_AND_BUS = (
    *(
        RealAxis(f"cart on a current, {what}", current_cart(name), "A", ON_A_BELT, "m")
        for what, name in CART_RUNS.items()
    ),
    RealAxis("cart on a current, swing-up", current_cart(SWING_UP_RUN, 4, 11), "A", ON_A_BELT, "m"),
    *(RealAxis(f"motor {k} on a bus", bus_motor(k), "N*m", STICKS) for k in (1, 3, 5)),
    *(
        RealAxis(f"bare motor, test {name}", driven_by_test(name), "V", position_unit="turn")
        for name in ("chirp1", "step1")
    ),
    RealAxis(
        "balancing robot's wheel",
        balancing_wheel("test3b_square_2026-04-21", 0),
        "V",
        ("input_lag", "input_delay"),
        "m",
    ),
    *(
        RealAxis(f"direct drive, joint {k}", direct_drive(k, "20"), "N*m", ("gravity",))
        for k in (1, 2)
    ),
    RealAxis("pump's rod", pump_actuator(PUMP_RUN, rod=True), "%", position_unit="m"),
)
