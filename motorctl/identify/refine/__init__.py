"""Refine a configuration from what a diagnosis found, keeping the user's file as it is written."""
