"""Tuned gains judged: against a grid that is run by brute force, on plants that are known."""
