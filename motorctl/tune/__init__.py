"""Gains from margins: what a log tells of an axis' loop, and the gains that would do better."""
