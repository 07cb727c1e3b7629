#!/usr/bin/env python3
"""Proves the monitor: bad senders, each misbehaving once in one way, are all caught for what they did; good ones,
at every limit that is still lawful, raise nothing. Its CRC and decoding are held against test/can/vectors.csv.

  prove.py [--bad N] [--good N]     exit status 0 when all of it holds
"""
import argparse
import fnmatch
import pathlib
import sys

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import dbc  # noqa: E402
import seeded_traffic  # noqa: E402
import traffic  # noqa: E402
from judge import Judge  # noqa: E402
from protection import crc, frame_crc  # noqa: E402

CONFIG = HERE.parents[1] / 'config'
DBC = {'plain': CONFIG / 'tunnel_pilot.dbc', 'j1939': CONFIG / 'tunnel_pilot_j1939.dbc'}


def judged(items, profile):
    judge = Judge(DBC[profile])
    traffic.judge_log(judge, list(seeded_traffic.log_lines(items, DBC[profile])))
    return judge


def wrong_verdicts(profile, kinds, count, expected_of):
    """Senders whose findings are not the expected ones (None: no finding)."""
    for seed in range(count):
        sender = kinds[seed % len(kinds)]
        act, expected = (sender, None) if expected_of is None else sender
        drive = seeded_traffic.Drive(seed, profile == 'j1939').started()
        began = drive.time
        act(drive)
        found = judged(drive.items, profile)
        told = dict(found.reasons)
        if expected is None and told:
            yield f'{profile}: good sender {act.__name__}, seed {seed}: {told}; {found.findings[0]}'
        elif expected and not fnmatch.filter(told, expected):
            yield f'{profile}: bad sender {act.__name__}, seed {seed}: {expected} was not found, but {told}'
        elif expected and found.findings[0].time < began:
            yield f'{profile}: bad sender {act.__name__}, seed {seed}: blamed before it misbehaved; {found.findings[0]}'


def wrong_decodings():
    layouts = dbc.read(DBC['plain'])
    if crc(b'123456789') != 0xDF:
        yield 'check value of the CRC'
    lines = (HERE.parent / 'can' / 'vectors.csv').read_text().splitlines()
    for line in lines:
        _, name, data, *fields = line.split(',')
        number, layout = int.from_bytes(bytes.fromhex(data), 'little'), layouts[name]
        if number & 0xFF != frame_crc(number, layout.data_id):
            yield f'CRC of {line[:50]}'
        for signal, value in (field.split('=') for field in fields):
            wire = layout.signals[signal]
            if abs(wire.raw(number) * wire.factor - float(value)) > 0.5001 * wire.factor:
                yield f'{signal} of {line[:50]}'
    if len(lines) < 100:
        yield f'only {len(lines)} vectors'


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--bad', type=int, default=100)
    parser.add_argument('--good', type=int, default=100)
    options = parser.parse_args()
    wrong = list(wrong_decodings())
    kinds = {'plain': (seeded_traffic.BAD, seeded_traffic.GOOD),
             'j1939': (seeded_traffic.BAD + seeded_traffic.J1939_BAD, seeded_traffic.GOOD + seeded_traffic.J1939_GOOD)}
    for profile, (bad, good) in kinds.items():
        wrong += wrong_verdicts(profile, bad, options.bad, True)
        wrong += wrong_verdicts(profile, good, options.good, None)
        print(f'{profile}: {options.bad} bad senders of {len(bad)} kinds, {options.good} good ones of {len(good)}')
    print('\n'.join(wrong + [f'{len(wrong)} wrong verdicts']))
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
