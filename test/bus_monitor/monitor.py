#!/usr/bin/env python3
"""Judges the pilot's frames on the bus by the definition of an unsafe frame (docs/can.md).

  monitor.py LOG [--events FILE]      a log of `candump -L`; - is the standard input
  monitor.py --embedded NAME          the embedded bus NAME, live
  monitor.py --interface can0         an interface of the kernel, live (needs python3-can)

Events (what happened off the bus) may stand in a file of their own or among the frames. Without any, give
--no-events: then stop requests, the operator's edges and the measurements are not judged.
Prints a summary, with --json the whole report. Exit status: 0 no unsafe frame, 1 some, 2 bad input.
"""
import argparse
import contextlib
import json
import pathlib
import signal
import sys
import time

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import traffic  # noqa: E402
from judge import MS, Judge  # noqa: E402

CONFIG = pathlib.Path(__file__).resolve().parents[2] / 'config'
DBC = {'plain': CONFIG / 'tunnel_pilot.dbc', 'j1939': CONFIG / 'tunnel_pilot_j1939.dbc'}
SHOWN = 20  # findings in the summary


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument('log', nargs='?', help='file of `candump -L`, - for the standard input')
    where.add_argument('--embedded', metavar='NAME')
    where.add_argument('--interface', metavar='NAME')
    parser.add_argument('--events', metavar='FILE', help='the log of events, when it is not among the frames')
    parser.add_argument('--no-events', action='store_true', help='there is none; live always so')
    parser.add_argument('--profile', choices=list(DBC), default='plain', help='of the bus: which .dbc of config/')
    parser.add_argument('--dbc', metavar='FILE', help='instead of it')
    parser.add_argument('--name', metavar='NAME', type=lambda text: int(text, 0),
                        help="the pilot's NAME under j1939; default: of whoever first claims its address")
    parser.add_argument('--jitter', type=float, metavar='MS', help='of time stamps; 0 for a log, 10 live')
    parser.add_argument('--seconds', type=float, default=float('inf'), help='live: for so long (or until interrupted)')
    parser.add_argument('--json', action='store_true', help='the whole report instead of the summary')
    parsed = parser.parse_args()
    if parsed.log is None and parsed.events:
        parser.error('--events goes with a log')
    parsed.dbc = parsed.dbc or str(DBC[parsed.profile])
    return parsed


def opened(stack, name):
    return sys.stdin if name == '-' else stack.enter_context(open(name, encoding='ascii'))


def judged_log(options):
    judge = Judge(options.dbc, not options.no_events, round((options.jitter or 0.0) * MS), options.name)
    with contextlib.ExitStack() as stack:
        names = [options.log] + ([options.events] if options.events else [])
        traffic.judge_log(judge, *(opened(stack, name) for name in names))
    if not judge.counts['frames']:
        raise traffic.BadLog(f'{options.log}: no frames in it')
    return judge


def judged_live(options):
    judge = Judge(options.dbc, False, round((10.0 if options.jitter is None else options.jitter) * MS), options.name)
    bus = traffic.EmbeddedBus(options.embedded) if options.embedded else traffic.KernelBus(options.interface)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        bus.run(judge, time.monotonic() + options.seconds)
    except KeyboardInterrupt:
        pass  # the end that was asked for
    finally:
        bus.close()
    return judge


def summary(report):
    for finding in report['unsafe'][:SHOWN]:
        print('{time:.6f} s ({clause}) {kind}: {detail}; {frame}'.format(**finding))
    if len(report['unsafe']) > SHOWN:
        print(f"... and {len(report['unsafe']) - SHOWN} more")
    for reason, count in report['reasons'].items():
        print(f'{count:8d} ({reason.split(" ", 1)[0]}) {reason.split(" ", 1)[1]}')
    judged = '' if report['events_judged'] else ' (without a log of events)'
    print('{frames} frames, {pilot_frames} of the pilot, {unsafe_frames} unsafe'.format(**report) + judged)


def main():
    options = arguments()
    try:
        judge = judged_log(options) if options.log else judged_live(options)
    except (OSError, ValueError, ImportError) as error:
        print(f'monitor.py: {error}', file=sys.stderr)
        return 2
    report = judge.report()
    if options.json:
        json.dump(report, sys.stdout, indent=1)
        print()
    else:
        summary(report)
    return 1 if report['unsafe_frames'] else 0


if __name__ == '__main__':
    sys.exit(main())
