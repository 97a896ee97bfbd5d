"""The demonstration: the published experiment on the simulated gantry, told from end to end."""
