"""Where frames and events come from: logs in the format of `candump -L`, the embedded bus, an interface of the kernel."""
import glob
import heapq
import os
import pathlib
import select
import socket
import struct
import time

EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000
CAN_FRAME = struct.Struct('=IB3x8s')


class BadLog(ValueError):
    """A line that is neither a frame nor an event, with its place."""


def microseconds(word):
    """'(12.000345)' as integer microseconds, without a float between."""
    seconds, _, fraction = word[1:-1].partition('.')
    return int(seconds) * 1_000_000 + int((fraction + '000000')[:6])


def frame_of(word):
    """(identifier with flags, length, data as a number) of '110#0011' or '123#R4'."""
    identifier, _, data = word.partition('#')
    flags = EXTENDED if len(identifier) > 3 else 0
    if data[:1] in ('R', 'r'):
        return int(identifier, 16) | flags | REMOTE, int(data[1:] or 0), 0
    payload = bytes.fromhex(data)
    if len(payload) > 8:
        raise ValueError('more than 8 bytes')
    return int(identifier, 16) | flags, len(payload), int.from_bytes(payload, 'little')


def lines_of(file, name):
    """(time, 0 event | 1 frame, words) of every line: what happened off the bus sorts before a frame of its time."""
    for number, line in enumerate(file, 1):
        words = line.split()
        if not words or words[0][0] == '#':
            continue
        try:
            stamp = microseconds(words[0])
            if words[1] == 'event':
                yield stamp, 0, words[2:]
            elif '#' in words[2]:
                yield stamp, 1, words[2]
            else:
                raise ValueError
        except (ValueError, IndexError):
            raise BadLog(f'{name}, line {number}: neither a frame nor an event: {line.strip()[:80]}') from None


def judge_log(judge, *logs):
    """Judges logs that are open files, merged by time; each must be in the order of its own."""
    streams = [lines_of(file, getattr(file, 'name', 'log')) for file in logs]
    merged = streams[0] if len(streams) == 1 else heapq.merge(*streams, key=lambda line: line[:2])
    last = None
    for stamp, kind, words in merged:
        if last is not None and stamp < last:
            raise BadLog(f'time goes back, from {last / 1e6:.6f} to {stamp / 1e6:.6f} s')
        last = stamp
        try:
            if kind == 0:
                judge.event(stamp, words[0], words[1:])
                continue
            identifier, length, data = frame_of(words)
        except (ValueError, IndexError) as error:
            raise BadLog(f'at {stamp / 1e6:.6f} s: {error}') from None
        _give(judge, stamp, identifier, length, data, None)


def _give(judge, stamp, identifier, length, data, sender):
    if identifier & ERROR:
        judge.counts['other frames'] += 1
        judge.counts['frames'] += 1
        return
    number = identifier & (EXTENDED | 0x1FFFFFFF if identifier & EXTENDED else 0x7FF)
    judge.frame(stamp, number, length, data, bool(identifier & REMOTE), sender)


def embedded_folder(name):
    base = os.environ.get('XDG_RUNTIME_DIR')
    return pathlib.Path(f'{base}/tunnel_pilot_can/{name}' if base else f'/tmp/tunnel_pilot_can.{os.getuid()}/{name}')


class EmbeddedBus:
    """Listens on the embedded bus (docs/can.md). The first socket that sends TP_COMMAND is taken for the pilot's:
    whoever else sends under the pilot's identifiers is a foreign sender."""

    def __init__(self, name):
        folder = embedded_folder(name)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.path = str(folder / f'monitor-{os.getpid()}.sock')
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.socket.setblocking(False)
        self.pilot = None

    def close(self):
        self.socket.close()
        os.unlink(self.path)

    def run(self, judge, until):
        while (left := until - time.monotonic()) > 0:
            if not select.select([self.socket], [], [], min(left, 0.1))[0]:
                continue
            stamp = time.time_ns() // 1000
            datagram, sender = self.socket.recvfrom(64)
            if len(datagram) != CAN_FRAME.size:
                judge.counts['malformed datagrams'] += 1
                continue
            identifier, length, data = CAN_FRAME.unpack(datagram)
            _give(judge, stamp, identifier, min(length, 8), int.from_bytes(data[:min(length, 8)], 'little'),
                  self._is_pilot(judge, identifier, sender))

    def _is_pilot(self, judge, identifier, sender):
        if identifier & (REMOTE | ERROR) or not judge.is_pilots(identifier):
            return None
        self.pilot = self.pilot or sender
        return sender == self.pilot

    def others(self):
        return [path for path in glob.glob(os.path.dirname(self.path) + '/*.sock') if path != self.path]


class KernelBus:
    """Listens on an interface of the kernel through python-can (Debian: python3-can)."""

    def __init__(self, channel):
        import can  # only who has kernel CAN needs it
        self.bus = can.Bus(channel=channel, interface='socketcan')

    def close(self):
        self.bus.shutdown()

    def run(self, judge, until):
        while (left := until - time.monotonic()) > 0:
            message = self.bus.recv(min(left, 0.1))
            if message is None:
                continue
            flags = EXTENDED * message.is_extended_id | REMOTE * message.is_remote_frame | ERROR * message.is_error_frame
            _give(judge, round(message.timestamp * 1e6), message.arbitration_id | flags, message.dlc,
                  int.from_bytes(message.data, 'little'), None)
