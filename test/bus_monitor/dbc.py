"""Reads what the monitor needs of a .dbc: frames, signals, value tables and DataIds."""
import re
from dataclasses import dataclass, field

FRAME = re.compile(r'BO_ (\d+) (\w+): (\d+) (\w+)')
SIGNAL = re.compile(r' SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\]')
VALUES = re.compile(r'VAL_ (\d+) (\w+) (.*);')
DATA_ID = re.compile(r'BA_ "DataId" BO_ (\d+) (\d+);')
WORD = re.compile(r'(\d+) "([^"]*)"')


@dataclass(frozen=True)
class Signal:
    """Little-endian, without offset; `low` and `high` are the raw values of the range."""
    start: int
    mask: int
    sign: int  # bit of the sign, 0 where there is none
    factor: float
    low: int
    high: int

    def raw(self, data):
        value = data >> self.start & self.mask
        return value - 2 * self.sign if value & self.sign else value

    def encoded(self, value):
        """The bits of a physical value. Nothing is held against the range."""
        return (round(value / self.factor) & self.mask) << self.start


@dataclass
class Frame:
    identifier: int
    name: str
    length: int
    sender: str
    data_id: int = 0
    signals: dict = field(default_factory=dict)
    values: dict = field(default_factory=dict)


def read(path):
    """All frames of a .dbc by name. Throws ValueError for signals that this reader does not know."""
    frames, last = {}, None
    with open(path, encoding='utf-8') as file:
        for line in file:
            if match := FRAME.match(line):
                last = Frame(int(match[1]), match[2], int(match[3]), match[4])
                frames[last.identifier] = last
            elif line.startswith(' SG_ '):
                last.signals.update([_signal(line)])
            elif match := VALUES.match(line):
                frames[int(match[1])].values[match[2]] = {int(n): word for n, word in WORD.findall(match[3])}
            elif match := DATA_ID.match(line):
                frames[int(match[1])].data_id = int(match[2])
    if not frames:
        raise ValueError(f'{path}: no frames in it')
    return {frame.name: frame for frame in frames.values()}


def _signal(line):
    match = SIGNAL.match(line)
    if not match or float(match[6]) != 0.0:
        raise ValueError(f'not a little-endian signal without offset: {line.strip()}')
    size, factor = int(match[3]), float(match[5])
    sign = 1 << size - 1 if match[4] == '-' else 0
    low, high = (round(float(bound) / factor) for bound in (match[7], match[8]))
    return match[1], Signal(int(match[2]), (1 << size) - 1, sign, factor, low, high)
