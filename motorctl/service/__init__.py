"""The daemon as a service: unit, user, group and device rules, put into a system and taken out."""

from motorctl.service.install import Request, install
from motorctl.service.outcome import Outcome
from motorctl.service.remove import remove

__all__ = ["Outcome", "Request", "install", "remove"]
