"""The version of motorctl that is installed."""

from importlib.metadata import version

VERSION = version("motorctl")
