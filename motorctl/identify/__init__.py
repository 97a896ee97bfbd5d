"""Identification from recordings alone: fit, diagnose, refine and compare."""
