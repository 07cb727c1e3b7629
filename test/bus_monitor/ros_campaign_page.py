#!/usr/bin/env python3
"""Makes docs/ros_campaign.md from what the campaign injected and what the monitor found; for scripts/ros_campaign.

Exit status 1 when a frame of the pilot's was unsafe or there was nothing to judge. With --bad-sender LOG, 0 only when every
frame of the bad sender's in that log was found for what it breaks: the angle leaps, and where another of its own came just
before, the counter stands.
"""
import argparse
import json
import sys

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument('report')
parser.add_argument('judged')
for name in ('seed', 'asked'):
    parser.add_argument(f'--{name}', type=int, required=True)
parser.add_argument('--python', required=True, help='what the monitor ran in')
parser.add_argument('--bad-sender', metavar='LOG')
options = parser.parse_args()
with open(options.report, encoding='utf-8') as file:
    report = json.load(file)
with open(options.judged, encoding='utf-8') as file:
    judged = json.load(file)


def table(title, counts):
    rows = '\n'.join(f'| {name} | {count} |' for name, count in sorted(counts.items(), key=lambda item: -item[1]))
    return f'| {title} | times |\n|---|---|\n{rows}\n'


driven = report['injections']
of = '' if driven >= options.asked else f' (of {options.asked} asked for)'
unsafe = judged['unsafe_frames']
print(f'''# Fault campaign at the level of ROS

Made by `scripts/ros_campaign --injections {options.asked} --seed {options.seed}`: the nodes of `pilot.launch` (the nodelets in their
manager, `can_bridge` a process), with the simulator's truck and world in lockstep, in simulated time. An injection is one
faulty message, a scan withheld, a call, a jump of the clock, a pause, or a process killed, held up or unloaded. They come
in bursts, as a rule of several kinds, while the truck drives; between them the operator resets and engages. The seed draws the
faults; when exactly a message arrives is the machine's, so two runs are alike, not the same. The independent monitor
([can.md](can.md), "Unsafe frames") judges every frame on the bus: by the campaign's own log of which scans were good,
what the operator asked for and when the arbiter asked for a stop. The bridge's clock comes in ticks of 10 ms, of which every other
one is not waited for; so the monitor takes the log's times to be up to 20 ms late (`--jitter 20`), and its limits in
milliseconds are that much wider than in the campaign in virtual time ([fault_campaign.md](fault_campaign.md)).

| what | |
|---|---|
| injections | {driven}{of}, in {report['bursts']} bursts |
| times that the truck came to drive | {report['engaged']} |
| judged | {judged['frames']} frames, {judged['pilot_frames']} under the pilot's identifiers, in {options.python} |
| **unsafe frames** | **{unsafe}** |
| waits of 1 s in vain for a frame of the bridge | {report['late_sets']} |
| longest time between two of its sets, where it was not started anew | {judged['longest_silence_ms']:.0f} ms |
| contacts of the truck with a wall | {report['contacts']} |
| time | {report['simulated_seconds']:.0f} s simulated in {report['seconds']:.0f} s |
''')
print(table('injections', report['kinds']))
print(table("safety state when injected, as the campaign knew it", report['states']))
print(table('stops, by the reason that the bridge gave', report['stops']))
if unsafe:
    print(table('unsafe because', judged['reasons']))
    for finding in judged['unsafe'][:20]:
        print('- {time:.6f} s: {kind}, {detail}, `{frame}`'.format(**finding))
if options.bad_sender:
    bad = report['bad_frame']
    with open(options.bad_sender, encoding='utf-8') as file:
        sent = sum(line.split()[-1] == bad for line in file)
    found = {f['time'] for f in judged['unsafe'] if f['frame'] == bad and (f['clause'], f['kind']) in (('b', 'rate'), ('a', 'counter'))}
    print(f'\nThe bad sender sent {sent} frames, {len(found)} were found for the angle or the counter.')
    sys.exit(0 if sent and len(found) == sent else 1)
sys.exit(1 if unsafe or not judged['pilot_frames'] else 0)
