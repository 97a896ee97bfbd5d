"""Machines simulated by other hands than motorctl's own, and how its diagnosis fares on them."""
