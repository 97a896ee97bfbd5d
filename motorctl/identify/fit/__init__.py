"""Identify the declared model of an axis from a recording."""
