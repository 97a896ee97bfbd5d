"""Compiled kernels: how they are compiled, and where compiled code is kept between starts."""

from motorctl.cache_folder import cache_root
from motorctl.kernels.beside import CompilingBeside
from motorctl.kernels.cache import kernels_cached
from motorctl.kernels.generated import is_kept, load_generated, source_digest, specialise
from motorctl.kernels.inner import inner_kernel
from motorctl.kernels.sent import SentKernel, know_arguments, packed, unpacked
from motorctl.kernels.telling import compiling_told

__all__ = [
    "CompilingBeside",
    "SentKernel",
    "cache_root",
    "compiling_told",
    "inner_kernel",
    "is_kept",
    "kernels_cached",
    "know_arguments",
    "load_generated",
    "packed",
    "source_digest",
    "specialise",
    "unpacked",
]
