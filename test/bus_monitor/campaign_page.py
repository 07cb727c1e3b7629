#!/usr/bin/env python3
"""Makes docs/fault_campaign.md from the monitor's report and the table of latencies; for scripts/fault_campaign.

Exit status 1 when a frame of the pilot's was unsafe or there was nothing to judge.
"""
import argparse
import json
import sys

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument('report')
parser.add_argument('latencies')
for name in ('cycles', 'seed', 'share', 'seconds'):
    parser.add_argument(f'--{name}', type=int, required=True)
parser.add_argument('--profile', default='plain')
options = parser.parse_args()
with open(options.report, encoding='utf-8') as file:
    report = json.load(file)
with open(options.latencies, encoding='utf-8') as file:
    latencies = file.read()

j1939 = options.profile == 'j1939'
profile = ' --profile j1939' if j1939 else ''
title = 'Fault campaign on a J1939 network' if j1939 else 'Fault campaign'
network = """
Requests for claims, and claims of the pilot's address under a higher NAME (answered) and a lower one (after which the
pilot is silent until the next pair) come beside them, and frames of the truck's groups from another address.""" if j1939 else ''
foreign = report['foreign_frames']
unsafe = report['unsafe_frames'] - foreign
judged = 'all of them' if options.share == 1 else f'every {options.share}th minute of them'
reasons = [f'| ({reason.split(" ", 1)[0]}) {reason.split(" ", 1)[1]} | {count} |'
           for reason, count in report['reasons'].items() if reason != 'e foreign']
print(f'''# {title}

Made by `scripts/fault_campaign --cycles {options.cycles} --seed {options.seed} --share {options.share}{profile}`: the bridge and the simulator's
truck controller in virtual time, a new pair every minute, ticks of 5, 10 and 20 ms. Operator's edges, commands (any angle
and speed that is not refused), lost, late, backward, not finite and out of range commands, frozen measurements, lost, corrupt and
repeated frames of the truck, a truck that hears half, foreign frames, the operator's wheel and key, faults of the
truck, states of the bus and jumps of the clock come at random, one over the other.{network} The independent monitor
([can.md](can.md), "Unsafe frames") judges.

| what | |
|---|---|
| control cycles driven | {options.cycles} |
| judged | {judged}: {report['frames']} frames, {report['pilot_frames']} under the pilot's identifiers |
| foreign frames injected, as the log of events tells | {foreign} |
| wrong frames of the truck | {report['wrong_truck_frames']} |
| **unsafe frames of the pilot's** | **{unsafe}** |
| time, driving and judging side by side | {options.seconds} s, {report['frames'] // max(options.seconds, 1)} frames/s |
''')
if reasons:
    print('| unsafe because | times |\n|---|---|\n' + '\n'.join(reasons) + '\n')
    for finding in [f for f in report['unsafe'] if f['kind'] != 'foreign'][:20]:
        print('- {time:.6f} s: {kind}, {detail}, `{frame}`'.format(**finding))
    print()
print(f'''## Worst latencies

From the last good word, or the fault, to the first frame that stops or does not steer, at ticks of 5 / 20 ms; three seeds
from {options.seed} with ten phases each. In STANDBY nothing drives: the operator engages at the limit, and the truck stands.

{latencies}''', end='')
sys.exit(1 if unsafe or not report['pilot_frames'] else 0)
