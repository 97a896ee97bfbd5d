"""Configuration: a YAML file becomes a frozen, fully checked machine description."""

from motorctl.config.load import load, load_resolved
from motorctl.config.machine import Machine
from motorctl.config.named_code import ALLOWED_CODE, AllowedCode, NamedCode, code_of_file
from motorctl.config.schema import config_schema
from motorctl.config.shipped import shipped_config, shipped_configs
from motorctl.config.summary import summarise

__all__ = [
    "ALLOWED_CODE",
    "AllowedCode",
    "Machine",
    "NamedCode",
    "code_of_file",
    "config_schema",
    "load",
    "load_resolved",
    "shipped_config",
    "shipped_configs",
    "summarise",
]
