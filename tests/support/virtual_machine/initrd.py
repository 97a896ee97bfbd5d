"""The first file system of the machine: loads the modules of the disk and goes there."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

# In this order: each needs those before it.
MODULES = (
    "virtio_ring",
    "virtio",
    "virtio_pci_modern_dev",
    "virtio_pci_legacy_dev",
    "virtio_pci",
    "virtio_blk",
    "crc32c_generic",
    "libcrc32c",
    "crc16",
    "mbcache",
    "jbd2",
    "ext4",
)
SCRIPT = f"""#!/bin/busybox sh
/bin/busybox mount -t devtmpfs dev /dev
for name in {" ".join(MODULES)}; do /bin/busybox insmod /$name.ko; done
/bin/busybox mount -t ext4 /dev/vda /root
/bin/busybox umount /dev
# the kernel hands on its words that it does not know
init=/sbin/machine-init
if [ "$machine_boot" = systemd ]; then init=/lib/systemd/systemd; fi
exec /bin/busybox switch_root /root $init
"""
FOLDER, PROGRAM = 0o40755, 0o100755


def make_initrd(busybox: Path, kernel: Path) -> bytes:
    """Return the initrd, with modules from an unpacked kernel package."""
    modules = {path.stem: path for path in kernel.rglob("*.ko")}
    files = [(name, FOLDER, b"") for name in ("bin", "dev", "root")]
    files += [("bin/busybox", PROGRAM, busybox.read_bytes()), ("init", PROGRAM, SCRIPT.encode())]
    files += [(f"{name}.ko", PROGRAM, modules[name].read_bytes()) for name in MODULES]
    return b"".join(_entries(files))


def _entries(files: Iterable[tuple[str, int, bytes]]) -> Iterable[bytes]:
    """Write an archive as the kernel reads it: cpio, "newc"."""
    for number, (name, mode, data) in enumerate([*files, ("TRAILER!!!", 0, b"")], 1):
        path = name.encode() + b"\0"
        fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(path), 0)
        head = b"070701" + b"".join(b"%08X" % field for field in fields) + path
        yield head + b"\0" * (-len(head) % 4)
        yield data + b"\0" * (-len(data) % 4)
