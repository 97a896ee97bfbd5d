"""The object dictionary of a CiA 402 drive, as far as it is used, and what an SDO abort says."""

from __future__ import annotations

from dataclasses import dataclass

SYNC_ID = 0x080
NMT_ID = 0x000
EMCY_ID, TPDO1_ID, RPDO1_ID, TPDO2_ID = 0x080, 0x180, 0x200, 0x280
SDO_ANSWER_ID, SDO_REQUEST_ID, HEARTBEAT_ID = 0x580, 0x600, 0x700

NMT_START, NMT_PRE_OPERATIONAL, NMT_RESET_COMMUNICATION = 0x01, 0x80, 0x82
BOOT_UP, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x05, 0x7F

PROFILE_402 = 402
TORQUE_MODE = 10  # cyclic synchronous torque
TORQUE_MODE_BIT = 9  # of the supported drive modes
SYNCHRONOUS, ON_ARRIVAL = 1, 255  # transmission types: with every SYNC; as soon as it has come
PDO_OFF = 1 << 31
NO_REMOTE_REQUEST = 1 << 30
MODES = {
    0: "profile position",
    1: "velocity",
    2: "profile velocity",
    3: "profile torque",
    5: "homing",
    6: "interpolated position",
    7: "cyclic synchronous position",
    8: "cyclic synchronous velocity",
    9: "cyclic synchronous torque",
}


@dataclass(frozen=True)
class Object:
    """An entry of the object dictionary."""

    index: int
    subindex: int
    size: int
    """Bytes of its value."""
    name: str

    @property
    def address(self) -> str:
        """Return how the entry is written in manuals, as in 1A00h:01."""
        return f"{self.index:04X}h:{self.subindex:02X}"

    @property
    def mapped(self) -> int:
        """Return the word that maps it into a PDO."""
        return self.index << 16 | self.subindex << 8 | self.size * 8


DEVICE_TYPE = Object(0x1000, 0, 4, "device type")
SYNC_COB_ID = Object(0x1005, 0, 4, "identifier of SYNC")
CONSUMER_HEARTBEAT = Object(0x1016, 1, 4, "consumer heartbeat time")
PRODUCER_HEARTBEAT = Object(0x1017, 0, 2, "producer heartbeat time")
ABORT_CONNECTION = Object(0x6007, 0, 2, "abort connection option code")
ERROR_CODE = Object(0x603F, 0, 2, "error code")
CONTROLWORD = Object(0x6040, 0, 2, "controlword")
STATUSWORD = Object(0x6041, 0, 2, "statusword")
MODE = Object(0x6060, 0, 1, "mode of operation")
MODE_SHOWN = Object(0x6061, 0, 1, "mode of operation display")
POSITION = Object(0x6064, 0, 4, "position actual value")
TARGET_TORQUE = Object(0x6071, 0, 2, "target torque")
DIGITAL_INPUTS = Object(0x60FD, 0, 4, "digital inputs")
SUPPORTED_MODES = Object(0x6502, 0, 4, "supported drive modes")

COMMAND = (CONTROLWORD, TARGET_TORQUE)
STATE = (STATUSWORD, POSITION)


@dataclass(frozen=True)
class Pdo:
    """A PDO of a node: where its parameters and its mapping are."""

    name: str
    parameters: int
    mapping: int
    identifier: int

    def entry(self, subindex: int, size: int, what: str) -> Object:
        """Return an entry of its parameters."""
        return Object(self.parameters, subindex, size, f"{what} of {self.name}")

    def mapped(self, subindex: int) -> Object:
        """Return an entry of its mapping; 0 is the number of entries."""
        if subindex:
            return Object(self.mapping, subindex, 4, f"mapping of {self.name}")
        return Object(self.mapping, 0, 1, f"number of mapped objects of {self.name}")


RPDO1 = Pdo("RPDO 1", 0x1400, 0x1600, RPDO1_ID)
TPDO1 = Pdo("TPDO 1", 0x1800, 0x1A00, TPDO1_ID)
TPDO2 = Pdo("TPDO 2", 0x1801, 0x1A01, TPDO2_ID)
OTHER_TPDOS = (Pdo("TPDO 3", 0x1802, 0x1A02, 0x380), Pdo("TPDO 4", 0x1803, 0x1A03, 0x480))

NO_SUCH_OBJECT, NO_SUCH_SUBINDEX = 0x06020000, 0x06090011
ABORTS = {
    0x05030000: "the toggle bit did not alternate",
    0x05040000: "the transfer timed out",
    0x05040001: "the drive does not know this kind of transfer",
    0x05040005: "the drive is out of memory",
    0x06010000: "this access to the object is not supported",
    0x06010001: "the object can only be written",
    0x06010002: "the object can only be read",
    NO_SUCH_OBJECT: "the drive has no such object",
    0x06040041: "the object cannot be mapped into a PDO",
    0x06040042: "the mapped objects are longer than a PDO",
    0x06040043: "the parameters do not fit together",
    0x06040047: "the drive's own parts do not fit together",
    0x06060000: "the hardware failed",
    0x06070010: "the value has another type or length",
    0x06070012: "the value is too long for the object",
    0x06070013: "the value is too short for the object",
    NO_SUCH_SUBINDEX: "the object has no such subindex",
    0x06090030: "the value is out of range",
    0x06090031: "the value is too large",
    0x06090032: "the value is too small",
    0x06090036: "the maximum is below the minimum",
    0x060A0023: "the resource is not available",
    0x08000000: "the drive says no more than that it failed",
    0x08000020: "the drive cannot store or transfer it",
    0x08000021: "the drive is under local control",
    0x08000022: "the drive's present state does not allow it",
    0x08000023: "the drive has no object dictionary",
    0x08000024: "there is no data",
}


def abort_words(code: int) -> str:
    """Return in words why a drive refused, with the code in hexadecimal."""
    words = ABORTS.get(code, "for a reason of its own")
    return f"{words} (SDO abort {code:08X}h)"
