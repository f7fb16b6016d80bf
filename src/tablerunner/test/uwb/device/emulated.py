"""Devices that live in a test: a DWM1001 with its shell and its binary interface, and wires.

They know nothing of the code under test; what they say is from `device_writers`, what they do
from the makers' documents (docs/protocols.md). Times are given [s], so that a test can be as fast
as it likes.
"""

import contextlib
import os
import threading
import time
import tty
from pathlib import Path

from device_writers import lec_line, les_line, location_answer, tlv

BANNER = b'\r\n DWM1001 TWR Real Time Location System\r\n\r\n Help      :  ? or help\r\n\r\n'
PROMPT = b'dwm> '
ERROR = b'\x40\x01\x01'


class EmulatedDwm1001:
    """A module that is asked (`hear`) and that talks by itself (`tick`).

    Parameters
    ----------
    anchors : list
        (address, place [m], range [m]).
    place : tuple
        Where it believes itself to be [m].
    moving_s, still_s : float
        Update intervals.
    """

    def __init__(self, anchors, place, moving_s=0.1, still_s=10.0):
        self.anchors, self.place = anchors, place
        self.moving_s, self.still_s = moving_s, still_s
        self.moves = True
        self.in_network = True
        self.asleep = 0  # so often it loses what it is sent, waking up
        self.deaf = False
        self.commands = []
        self.requests = []
        self.resets = 0
        self.reset(0.0)

    def reset(self, now):
        """Start again, as after a fault or with power: out of the shell."""
        self.shell = False
        self.lines = b''  # lec or les, while they are on
        self._return_at = -10.0
        self._line = b''
        self._last = b''
        self._next = now + self.moving_s
        self._ready = False
        self.measured = []

    def hear(self, data, now):
        """Return what it answers at once."""
        if self.deaf:
            return b''
        if self.asleep:
            self.asleep -= 1
            return b''
        if self.shell:
            return self._hear_shell(data)
        if data.startswith(b'\r') and not data.strip(b'\r'):
            twice = len(data) > 1 or now - self._return_at <= 1.0
            self._return_at = now
            if twice:
                self.shell, self._line, self._last = True, b'', b''
                return BANNER + PROMPT
            return ERROR
        return self._answer(data) if data else b''

    def tick(self, now):
        """Return what it says by itself."""
        if now < self._next:
            return b''
        self._next = max(self._next, now - 0.1) + (self.moving_s if self.moves else self.still_s)
        if not self.in_network:
            return b''
        self._ready = True
        self.measured.append(now)
        if not (self.shell and self.lines):
            return b''
        write = lec_line if self.lines == b'lec' else les_line
        return write(self.anchors, self.place)

    def _hear_shell(self, data):
        said = b''
        for byte in data:
            if byte != 13:
                self._line += bytes([byte])
                said += bytes([byte])
                continue
            command, self._line = self._line or self._last, b''
            self._last = command
            if command:
                self.commands.append(command)
            said += b'\r\n' + self._obey(command)
            if not self.shell:
                return said
            said += PROMPT
        return said

    def _obey(self, command):
        if command in (b'lec', b'les'):
            self.lines = b'' if self.lines == command else command
        elif command == b'quit':
            self.shell, self.lines = False, b''
        elif command == b'si':
            moving, still = round(10 * self.moving_s), round(10 * self.still_s)
            return (
                '[000014.330 INF] sys: fw2 fw_ver=x01030001 cfg_ver=x00010700\r\n'
                '[000014.330 INF] mode: tn (act,twr,np,le)\r\n'
                '[000014.340 INF] cfg: sync=0 fwup=0 ble=1 leds=1 le=1 lp=0 stat_det=1 (sens=1) '
                f'mode=0 upd_rate_norm={moving} upd_rate_stat={still} label=DW0001\r\n'
            ).encode()
        elif command:
            return b'unknown command\r\n'
        return b''

    def _answer(self, data):
        self.requests.append(data)
        good = tlv(0x40, b'\x00')
        if data == b'\x15\x00':
            numbers = bytes([1, 0, 3, 1]), bytes([0, 7, 1, 0]), bytes([0x2A, 0, 0xCA, 0xDE])
            return good + tlv(0x50, numbers[0]) + tlv(0x51, numbers[1]) + tlv(0x52, numbers[2])
        if data == b'\x04\x00':
            intervals = (round(10 * self.moving_s), round(10 * self.still_s))
            return good + tlv(0x45, b''.join(n.to_bytes(2, 'little') for n in intervals))
        if data == b'\x08\x00':
            return good + tlv(0x46, b'\x01\x04')
        if data == b'\x32\x00':
            return good + tlv(0x5A, bytes([self._ready, 0]))
        if data == b'\x0c\x00':
            self._ready = False
            millimetres = [
                (address, round(1000 * metres), 90, tuple(round(1000 * x) for x in where))
                for address, where, metres in self.anchors
            ]
            return location_answer(millimetres, tuple(round(1000 * x) for x in self.place))
        return ERROR


class Wire:
    """A pseudo-terminal under a path that stays the same, as udev's links do."""

    def __init__(self, path):
        self.path = Path(path)
        self.master = -1

    def plug(self):
        """Make the port appear."""
        self.master, slave = os.openpty()
        tty.setraw(self.master)
        os.set_blocking(self.master, False)
        link = self.path.with_suffix('.new')
        link.symlink_to(os.ttyname(slave))
        link.rename(self.path)
        os.close(slave)

    def unplug(self):
        """Make it go, whoever has it open."""
        master, self.master = self.master, -1
        self.path.unlink(missing_ok=True)
        if master >= 0:
            os.close(master)

    def write(self, data):
        """Send bytes to whoever has the port open; what does not fit is lost."""
        with contextlib.suppress(OSError):
            os.write(self.master, data)

    def read(self):
        """Return what has been sent to the device."""
        try:
            return os.read(self.master, 4096)
        except OSError:  # nothing there, or nobody has the port open
            return b''


class Running:
    """Runs an emulated module on a wire, in a thread."""

    def __init__(self, module, wire):
        self._module, self._wire = module, wire
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._ending.set()
        self._thread.join()

    def _run(self):
        while not self._ending.is_set():
            now = time.monotonic()
            heard = self._wire.read()
            if heard:
                self._wire.write(self._module.hear(heard, now))
            said = self._module.tick(now)
            if said:
                self._wire.write(said)
            self._ending.wait(0.005)
