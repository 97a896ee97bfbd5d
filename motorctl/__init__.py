"""motorctl: real-time motion control that closes the loop with measured data."""

from importlib.metadata import version

__version__ = version("motorctl")
