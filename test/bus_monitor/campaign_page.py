#!/usr/bin/env python3
"""Makes docs/fault_campaign.md from the monitor's reports of all parts and the table of latencies; for scripts/fault_campaign.

Exit status 1 when a frame of the pilot's was unsafe or there was nothing to judge.
"""
import argparse
import json
import pathlib
import sys
from collections import Counter

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument('reports', help='folder')
parser.add_argument('latencies')
for name in ('seed', 'share', 'asked'):
    parser.add_argument(f'--{name}', type=int, required=True)
parser.add_argument('--python', required=True, help='what the monitor ran in')
parser.add_argument('--profile', default='plain')
options = parser.parse_args()
parts = []
for path in sorted(pathlib.Path(options.reports).glob('*.json'), key=lambda path: int(path.stem)):
    with open(path, encoding='utf-8') as file:
        parts.append({**json.load(file), 'seed': int(path.stem)})
if not parts:
    sys.exit('campaign_page.py: no reports')
cycles, seconds = (sum(part[name] for part in parts) for name in ('cycles', 'seconds'))
total, reasons, findings = Counter(), Counter(), []
for part in parts:
    report = part['report']
    reasons.update(report['reasons'])
    total.update({name: report[name] for name in ('frames', 'pilot_frames', 'wrong_truck_frames', 'unsafe_frames', 'foreign_frames')})
    findings += [(part['seed'], finding) for finding in report['unsafe'] if finding['kind'] != 'foreign']
with open(options.latencies, encoding='utf-8') as file:
    latencies = file.read()

j1939 = options.profile == 'j1939'
profile = ' --profile j1939' if j1939 else ''
title = 'Fault campaign on a J1939 network' if j1939 else 'Fault campaign'
network = """
Requests for claims, and claims of the pilot's address under a higher NAME (answered) and a lower one (after which the
pilot is silent until the next pair) come beside them, and frames of the truck's groups from another address.""" if j1939 else ''
foreign = total['foreign_frames']
unsafe = total['unsafe_frames'] - foreign
driven = cycles if cycles >= options.asked else f'{cycles} (of {options.asked} asked for)'
judged = 'all of them' if options.share == 1 else f'every {options.share}th minute of them'
rows = [f'| ({reason.split(" ", 1)[0]}) {reason.split(" ", 1)[1]} | {count} |'
           for reason, count in sorted(reasons.items()) if reason != 'e foreign']
print(f'''# {title}

Made by `scripts/fault_campaign --cycles {options.asked} --seed {options.seed} --share {options.share}{profile}`: the bridge and the simulator's
truck controller in virtual time, a new pair every minute, ticks of 5, 10 and 20 ms. Operator's edges, commands (any angle
and speed that is not refused), lost, late, backward, not finite and out of range commands, frozen measurements, lost, corrupt and
repeated frames of the truck, a truck that hears half, foreign frames, the operator's wheel and key, faults of the
truck, states of the bus and jumps of the clock come at random, one over the other.{network} The independent monitor
([can.md](can.md), "Unsafe frames") judges.

| what | |
|---|---|
| control cycles driven | {driven} |
| judged | {judged}: {total['frames']} frames, {total['pilot_frames']} under the pilot's identifiers |
| foreign frames injected, as the log of events tells | {foreign} |
| wrong frames of the truck | {total['wrong_truck_frames']} |
| **unsafe frames of the pilot's** | **{unsafe}** |
| parts | {len(parts)}, seeds {parts[0]['seed']} to {parts[-1]['seed']} |
| time of all parts, driving and judging side by side | {seconds} s, {total['frames'] // max(seconds, 1)} frames/s in {options.python} |
''')
if rows:
    print('| unsafe because | times |\n|---|---|\n' + '\n'.join(rows) + '\n')
    for seed, finding in findings[:20]:
        print(f'- seed {seed}, ' + '{time:.6f} s: {kind}, {detail}, `{frame}`'.format(**finding))
    print()
print(f'''## Worst latencies

From the last good word, or the fault, to the first frame that stops or does not steer, at ticks of 5 / 20 ms; three seeds
from {options.seed} with ten phases each. In STANDBY nothing drives: the operator engages at the limit, and the truck stands.

{latencies}''', end='')
sys.exit(1 if unsafe or not total['pilot_frames'] else 0)
