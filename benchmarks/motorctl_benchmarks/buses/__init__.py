"""The simulated gantry behind each bus, under C2 in wall-clock time, beside the direct one."""
