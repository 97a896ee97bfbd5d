"""Ordinary differential equations by scipy, sample by sample."""
