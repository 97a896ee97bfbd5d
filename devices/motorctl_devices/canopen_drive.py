"""A drive of CiA 402 as it sees itself: object dictionary, PDO mapping, and its state machine."""

from __future__ import annotations

from dataclasses import dataclass

CST = 10
STATUS = {
    "not ready": 0x00,
    "disabled": 0x40,
    "ready": 0x21,
    "switched on": 0x23,
    "enabled": 0x27,
    "quick stop": 0x07,
    "fault": 0x08,
}
REMOTE, VOLTAGE = 0x200, 0x10
OFF = 1 << 31
UPLOAD, DOWNLOAD, UNKNOWN_TRANSFER = 2, 1, 0x05040001

READ_ONLY, NO_OBJECT, NO_SUBINDEX = 0x06010002, 0x06020000, 0x06090011
NOT_MAPPABLE, TOO_LONG, BAD_SIZE, BAD_VALUE = 0x06040041, 0x06040042, 0x06070010, 0x06090030
MAPPABLE = {0x1600: {0x6040: 2, 0x6071: 2}, 0x1A00: {0x6041: 2, 0x6064: 4, 0x60FD: 4, 0x603F: 2}}


class AbortError(Exception):
    """An SDO transfer is refused."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}h")
        self.code = code


@dataclass
class Entry:
    """A value of the object dictionary."""

    size: int
    value: int
    writable: bool = True


class Drive:
    """Knows nothing of bus or motor: `obey` is told a controlword, `entries` hold the rest."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.begin()

    def begin(self) -> None:
        """Begin as after power-on."""
        self.state = "disabled"
        self._word = 0
        self.emergency: int | None = None
        """An error code that is to be sent; 0: it is over."""
        self.entries = {
            (0x1000, 0): Entry(4, 0x00020192, False),
            (0x1001, 0): Entry(1, 0, False),
            (0x603F, 0): Entry(2, 0, False),
            (0x6040, 0): Entry(2, 0),
            (0x6041, 0): Entry(2, 0, False),
            (0x6060, 0): Entry(1, 0),
            (0x6061, 0): Entry(1, 0, False),
            (0x6064, 0): Entry(4, 0, False),
            (0x6071, 0): Entry(2, 0),
            (0x60FD, 0): Entry(4, 0, False),
            (0x6502, 0): Entry(4, 1 << CST - 1, False),
        }
        self.begin_communication()

    def begin_communication(self) -> None:
        """Forget what was written of heartbeats and PDOs."""
        entries = self.entries
        entries[0x1005, 0] = Entry(4, 0x80)
        entries[0x1016, 0] = Entry(1, 1, False)
        entries[0x1016, 1] = Entry(4, 0)
        entries[0x1017, 0] = Entry(2, 0)
        entries[0x6007, 0] = Entry(2, 1)
        for first, mapping, base in ((0x1400, 0x1600, 0x200), (0x1800, 0x1A00, 0x180)):
            for i in range(4):
                cob_id = base + 0x100 * i + self.number | OFF
                entries[first + i, 1] = Entry(4, cob_id)
                entries[first + i, 2] = Entry(1, 255)
                entries[mapping + i, 0] = Entry(1, 0)
                for sub in range(1, 9):
                    entries[mapping + i, sub] = Entry(4, 0)

    def value(self, index: int, subindex: int = 0) -> int:
        """Return the value of an entry."""
        return self.entries[index, subindex].value

    def put(self, index: int, value: int) -> None:
        """Set a value that the drive itself tells."""
        entry = self.entries[index, 0]
        entry.value = value & (1 << 8 * entry.size) - 1

    def answer(self, request: bytes) -> bytes:
        """Return the answer to an SDO request; only transfers of one frame are known."""
        index, sub = int.from_bytes(request[1:3], "little"), request[3]
        head = request[1:4]
        try:
            if request[0] >> 5 == UPLOAD:
                entry = self._entry(index, sub)
                raw = entry.value.to_bytes(entry.size, "little").ljust(4, b"\0")
                return bytes([0x43 | (4 - entry.size) << 2]) + head + raw
            if request[0] >> 5 == DOWNLOAD and request[0] & 2:
                size = 4 - (request[0] >> 2 & 3) if request[0] & 1 else 4
                self._write(index, sub, request[4 : 4 + size])
                return b"\x60" + head + bytes(4)
            code = UNKNOWN_TRANSFER
        except AbortError as error:
            code = error.code
        return b"\x80" + head + code.to_bytes(4, "little")

    def _entry(self, index: int, sub: int) -> Entry:
        entry = self.entries.get((index, sub))
        if entry is None:
            known = any(known == index for known, _ in self.entries)
            raise AbortError(NO_SUBINDEX if known else NO_OBJECT)
        return entry

    def _write(self, index: int, sub: int, data: bytes) -> None:
        entry = self._entry(index, sub)
        if not entry.writable:
            raise AbortError(READ_ONLY)
        if len(data) != entry.size:
            raise AbortError(BAD_SIZE)
        value = int.from_bytes(data, "little")
        if index & ~3 in MAPPABLE and sub:
            sizes = MAPPABLE[index & ~3]
            if value and sizes.get(value >> 16, 0) * 8 != value & 0xFF:
                raise AbortError(NOT_MAPPABLE)
        elif index & ~3 in MAPPABLE:
            bits = sum(self.value(index, i) & 0xFF for i in range(1, min(value, 8) + 1))
            if value > 8 or bits > 64:
                raise AbortError(TOO_LONG)
        elif index == 0x6060:
            if value != CST:
                raise AbortError(BAD_VALUE)
            self.put(0x6061, value)
        entry.value = value
        if index == 0x6040:
            self.obey(value)

    def mapped(self, mapping: int) -> list[tuple[int, int]]:
        """Return index and size [B] of what a PDO carries."""
        words = [self.value(mapping, i + 1) for i in range(self.value(mapping))]
        return [(word >> 16, (word & 0xFF) // 8) for word in words]

    @property
    def enabled(self) -> bool:
        """Whether torque acts."""
        return self.state == "enabled"

    def tell_state(self) -> None:
        """Bring the statusword up to date."""
        self.put(0x6041, STATUS[self.state] | REMOTE | VOLTAGE)

    def fail(self, code: int) -> None:
        """Go into Fault for a reason, once."""
        if self.state != "fault":
            self.state = "fault"
            self.emergency = code
            self.put(0x603F, code)
            self.put(0x1001, 1)

    def obey(self, word: int) -> None:
        """Take a controlword: the commands of CiA 402, by their bits."""
        rising = word & ~self._word
        self._word = word
        state = self.state
        if state == "fault":
            if rising & 0x80:
                self.state = "disabled"
                self.emergency = 0
                self.put(0x603F, 0)
                self.put(0x1001, 0)
        elif not word & 0x02:
            self.state = "disabled"
        elif not word & 0x04:
            self.state = {"enabled": "quick stop", "quick stop": "quick stop"}.get(
                state, "disabled"
            )
        elif state == "quick stop":
            pass
        elif not word & 0x01:
            self.state = "ready"
        elif state == "disabled":
            pass
        elif not word & 0x08:
            self.state = "switched on"
        else:
            self.state = {"ready": "switched on"}.get(state, "enabled")
