#!/usr/bin/env python3
"""Frames made by an independent codec (cantools, from PyPI) out of config/tunnel_pilot.dbc and, which must be the same,
out of config/tunnel_pilot_j1939.dbc.

  make_vectors.py --write     writes vectors.csv beside this file
  make_vectors.py --check     makes them again and compares; exit status 77 where cantools cannot be had
  --venv DIR                  makes a virtual environment there, installs cantools, runs inside it

One line each: kind,frame,bytes in hex,Signal=value,... in the units of the wire.
  encode   random numbers, any digits: the codec must make exactly these bytes of them
  decode   random bits: the codec must read these numbers, and make the same bytes of them again
"""
import argparse
import os
import pathlib
import random
import shutil
import subprocess
import sys
import venv

HERE = pathlib.Path(__file__).resolve().parent
CONFIG = HERE.parents[1] / 'config'
DBC, DBC_J1939 = CONFIG / 'tunnel_pilot.dbc', CONFIG / 'tunnel_pilot_j1939.dbc'
VECTORS = HERE / 'vectors.csv'
RANDOM_LINES = 40  # of each kind and frame
CANTOOLS = 'cantools==40.2.3'


def crc8(data):
    """CRC-8 0x2F, initial value and final XOR 0xFF, bit by bit."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = ((crc << 1) ^ 0x2F if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF


def protect(message, data):
    return bytes([crc8(data[1:] + bytes([message.dbc.attributes['DataId'].value]))]) + data[1:]


def payload_signals(message):
    return [s for s in message.signals if s.name != 'Crc']


def random_value(rng, signal):
    scale = signal.conversion.scale
    if scale == 1:
        return rng.randint(int(signal.minimum), int(signal.maximum))
    low, high = round(signal.minimum / scale), round(signal.maximum / scale)
    # between two raw steps, but never near the tie where rounding rules differ
    raw = min(max(rng.randint(low, high) + rng.uniform(-0.45, 0.45), low), high)
    return min(max(raw * scale, signal.minimum), signal.maximum)


def line(kind, message, data, values):
    fields = [f'{s.name}={values[s.name]!r}' for s in payload_signals(message)]
    return ','.join([kind, message.name, data.hex()] + fields)


def encode_line(message, values):
    data = message.encode({**values, 'Crc': 0}, strict=True)
    return line('encode', message, protect(message, data), values)


def decode_line(rng, message):
    raw = {}
    for signal in message.signals:
        scale = signal.conversion.scale
        raw[signal.name] = rng.randint(round(signal.minimum / scale), round(signal.maximum / scale))
    data = protect(message, message.encode({**raw, 'Crc': 0}, scaling=False, strict=False))
    values = message.decode(data, decode_choices=False)
    return line('decode', message, data, values)


def boundary_lines(rng, message):
    for signal in payload_signals(message):
        for bound in (signal.minimum, signal.maximum):
            values = {s.name: random_value(rng, s) for s in payload_signals(message)}
            values[signal.name] = int(bound) if signal.conversion.scale == 1 else bound
            yield encode_line(message, values)


def make_lines(dbc):
    import cantools
    rng = random.Random(20190707)
    database = cantools.database.load_file(str(dbc))
    lines = []
    for message in sorted(database.messages, key=lambda m: m.dbc.attributes['DataId'].value):
        lines += boundary_lines(rng, message)
        for _ in range(RANDOM_LINES):
            lines.append(encode_line(message, {s.name: random_value(rng, s) for s in payload_signals(message)}))
            lines.append(decode_line(rng, message))
    return '\n'.join(lines) + '\n'


def can_import_cantools(python):
    try:
        return subprocess.run([python, '-c', 'import cantools'], stderr=subprocess.DEVNULL).returncode == 0
    except OSError:
        return False


def rerun_in_venv(folder, arguments):
    python = pathlib.Path(folder) / 'bin' / 'python3'
    if not can_import_cantools(python):
        try:
            venv.create(folder, with_pip=True, clear=True)
            subprocess.run([python, '-m', 'pip', 'install', '--quiet', '--retries', '1', CANTOOLS], check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            shutil.rmtree(folder, ignore_errors=True)  # the next try begins anew
            print(f'{error}\n{CANTOOLS} could not be installed from PyPI: nothing checked')
            return 77
    os.execv(python, [str(python), __file__] + arguments)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument('--write', action='store_true')
    what.add_argument('--check', action='store_true')
    parser.add_argument('--venv')
    options = parser.parse_args()
    if options.venv:
        return rerun_in_venv(options.venv, ['--write' if options.write else '--check'])
    try:
        lines, j1939 = make_lines(DBC), make_lines(DBC_J1939)
    except ImportError:
        print('cantools is not installed: nothing checked')
        return 77
    if lines != j1939:
        print(f'cantools makes other frames of {DBC_J1939} than of {DBC}')
        return 1
    if options.write:
        VECTORS.write_text(lines)
        print(f'{VECTORS}: {lines.count(chr(10))} vectors')
        return 0
    if VECTORS.read_text() != lines:
        print(f'{VECTORS} is not what cantools makes of {DBC}')
        return 1
    print(f'{lines.count(chr(10))} vectors agree with cantools')
    return 0


if __name__ == '__main__':
    sys.exit(main())
