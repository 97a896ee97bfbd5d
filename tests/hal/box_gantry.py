"""A motion box with the simulated gantry behind it, in a process of its own: `box_gantry.py`.

Prints the UDP port that it took, then answers until it is ended. It knows the box's datagrams from
docs/drivers/your_own.md.
"""

import socket
import struct
import sys

from motorctl.hal import Channel, Inputs, Outputs
from motorctl_sim import SimDriver, SimOptions

FLAGS = 0b11011
SILENCE_S = 0.5


def main() -> None:
    period_s = float(sys.argv[1])
    channels = [Channel(name, i, 0.5e-6, 32, 10.0) for i, name in enumerate("xy")]
    options = SimOptions(preset="published_gantry", seed=1)
    gantry = SimDriver(options, channels, period_s)
    seen, asked = Inputs(2), Outputs(2)
    gantry.open()
    line = socket.socket(type=socket.SOCK_DGRAM)
    line.bind(("127.0.0.1", 0))
    line.settimeout(SILENCE_S)
    print(line.getsockname()[1], flush=True)
    while True:
        try:
            datagram, host = line.recvfrom(64)
        except TimeoutError:
            gantry.safe()  # its watchdog
            continue
        number, *values = struct.unpack("<q2h2B", datagram)
        gantry.read(seen)  # with the volts until now
        asked.volts[:] = [code * 10.0 / 32767 for code in values[:2]]
        asked.enable[:] = values[2:]
        gantry.write(asked)
        flags = [int(word) & FLAGS for word in seen.status]
        line.sendto(struct.pack("<qI2i2B", number, 1, *seen.counts, *flags), host)


if __name__ == "__main__":
    main()
