"""Machines that others recorded: their axes, and what peers make of the same recordings."""
