"""Machines simulated by other hands, and how often the diagnosis is right on them."""
